// Two views of one camera of unknown focal length: F ~ K⁻ᵀ [t]× R K⁻¹, K = diag(f, f, 1), six parameters. Coordinates
// from the principal point, pixels square.
#pragma once

#include <fusion/two_view/epipolar_solvers.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/solutions.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <lie/essential.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>

namespace liestat {

/// A relative pose up to scale and the focal length that both views have, in the unit of the coordinates.
struct SharedFocalMotion {
  Essentiald pose = Essentiald();
  double focal_length = 1;
};

/// F = K⁻¹ E K⁻¹, ‖E‖² = 2.
inline Eigen::Matrix3d fundamentalFromMotion(const SharedFocalMotion& motion) {
  const Eigen::Vector3d k(1 / motion.focal_length, 1 / motion.focal_length, 1);
  return k.asDiagonal() * motion.pose.essentialMatrix() * k.asDiagonal();
}
/// The derivatives of its entries, column after column, by the tangent of the pose and by log f; exact.
inline Eigen::Matrix<double, 9, 6> fundamentalJacobian(const SharedFocalMotion& motion) {
  const double k[] = {1 / motion.focal_length, 1 / motion.focal_length, 1};
  const Eigen::Matrix3d F = fundamentalFromMotion(motion);
  Eigen::Matrix<double, 9, 6> J;
  J.leftCols<5>() = motion.pose.essentialMatrixJacobian();
  for (int j = 0; j < 3; ++j) {
    for (int i = 0; i < 3; ++i) {
      J.row(3 * j + i) *= k[i] * k[j];
      J(3 * j + i, 5) = -((i < 2 ? 1 : 0) + (j < 2 ? 1 : 0)) * F(i, j);
    }
  }
  return J;
}

/// The focal length that makes the two singular values of K F K most alike. They are so where
///
///   b² (u₂ᵀ ω u₂) (v₂ᵀ ω v₂) = a² (u₁ᵀ ω u₁) (v₁ᵀ ω v₁),   ω = diag(f², f², 1),
///
/// a, b the singular values of F, u_i, v_i its singular vectors: a quadratic equation for f² (Kruppa's; P. Sturm, "On focal
/// length calibration from two views", CVPR 2001). Nothing where it has no positive root, or vanishes to 1e-12: the optical
/// axes are parallel, or meet at equal distances. F of one camera has this focal length exactly.
inline std::optional<double> sharedFocalLength(const Eigen::Matrix3d& F) {
  if (!F.allFinite()) return std::nullopt;
  const detail::SmallSvd svd(detail::SmallMatrix::of<3, 3>(F));
  const double a = svd.value(0), b = svd.value(1);
  if (!(b > 1e-12 * a)) return std::nullopt;
  const double ratio = b * b / (a * a);
  // x²(1 - p)(1 - q) + x (p (1 - q) + q (1 - p)) + p q of two pairs, x = f².
  const auto pairOf = [](double u, double v) {
    const double p = u * u, q = v * v;
    return Eigen::Vector3d((1 - p) * (1 - q), p * (1 - q) + q * (1 - p), p * q);
  };
  const Eigen::Vector3d second = ratio * pairOf(svd.u(1, 2), svd.v(1, 2)), first = pairOf(svd.u(0, 2), svd.v(0, 2));
  const Eigen::Vector3d c = second - first;
  if (!(c.cwiseAbs().maxCoeff() > 1e-12 * (first + second).maxCoeff())) return std::nullopt;
  const double discriminant = c[1] * c[1] - 4 * c[0] * c[2];
  // A root that noise made complex was a double one.
  const double half = -0.5 * (c[1] + (c[1] >= 0 ? 1 : -1) * std::sqrt(std::max(0.0, discriminant)));
  std::optional<double> best;
  double least = std::numeric_limits<double>::infinity();
  for (const double x : {half / c[0], c[2] / half}) {
    if (!(x > 0) || !std::isfinite(x)) continue;
    const double f = std::sqrt(x);
    const Eigen::Vector3d k(f, f, 1);
    const detail::SmallSvd of_E(detail::SmallMatrix::of<3, 3>(k.asDiagonal() * F * k.asDiagonal()));
    const double unlike = (of_E.value(0) - of_E.value(1)) / (of_E.value(0) + of_E.value(1));
    if (unlike < least) least = unlike, best = f;
  }
  return best;
}

namespace detail {

/// One Gauss–Newton step of the matches' distances from their epipolar lines (Sampson's, of equal noise); false where it
/// has none.
inline bool polishSharedFocal(std::span<const Eigen::Vector4d> matches, SharedFocalMotion& motion) {
  const Eigen::Matrix3d F = fundamentalFromMotion(motion);
  const Eigen::Matrix<double, 9, 6> by_motion = fundamentalJacobian(motion);
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
  for (const Eigen::Vector4d& m : matches) {
    const Eigen::Vector3d u(m[0], m[1], 1), v(m[2], m[3], 1), line = F * u, back = F.transpose() * v;
    Eigen::Matrix<double, 1, 9> by_entries;
    for (int k = 0; k < 3; ++k) by_entries.segment<3>(3 * k) = (u[k] * v).transpose();
    const double weight = 1 / (line.head<2>().squaredNorm() + back.head<2>().squaredNorm());
    const Eigen::Matrix<double, 1, 6> J = by_entries * by_motion;
    A += weight * J.transpose() * J;
    g += weight * v.dot(line) * J.transpose();
  }
  // Directions that are hardly told do not run away.
  const double damping = 1e-9 * A.trace();
  A.diagonal().array() += damping;
  Eigen::Matrix<double, 6, 1> step;
  if (!solveStep<double, 6>(A, -g, step) || !step.allFinite() || !(std::abs(step[5]) < 2) ||
      !(step.head<5>().norm() < 1))
    return false;
  motion.pose = exp(motion.pose, Eigen::Matrix<double, 5, 1>(step.head<5>()));
  motion.focal_length *= std::exp(step[5]);
  return true;
}

}  // namespace detail

/// Motions of a camera of unknown focal length, of seven matches: fundamental matrices of these, up to three, each with
/// the focal length that suits it best, made a motion of one camera, and three steps towards the matches, for seven
/// equations are one more than the unknowns. Exact matches have an exact solution. (Six would do, at the price of a
/// polynomial of degree fifteen.) None where solveFundamental or sharedFocalLength has none; the side of the pose is left
/// open.
inline Solutions<SharedFocalMotion, 3> solveSharedFocal(std::span<const Eigen::Vector4d> matches) {
  Solutions<SharedFocalMotion, 3> result;
  if (matches.size() != 7) return result;
  for (const Eigen::Matrix3d& F : solveFundamental(matches)) {
    const std::optional<double> f = sharedFocalLength(F);
    if (!f) continue;
    const Eigen::Vector3d k(*f, *f, 1);
    const auto poses = posesOfEssential(k.asDiagonal() * F * k.asDiagonal());
    if (poses.empty()) continue;
    SharedFocalMotion motion{toEssential(poses[0]), *f};
    bool good = true;
    for (int step = 0; step < 3 && good; ++step) good = detail::polishSharedFocal(matches, motion);
    if (good && fundamentalFromMotion(motion).allFinite()) result.add(motion);
  }
  return result;
}

}  // namespace liestat
