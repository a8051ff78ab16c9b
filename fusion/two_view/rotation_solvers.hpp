// Closed-form solvers for a camera that turns, and one that zooms as well: ũ' ~ H ũ, H = R or diag(r, r, 1) R. Which
// samples have no solution: fusion/two_view/solvers.hpp.
#pragma once

#include <fusion/two_view/solutions.hpp>
#include <lie/detail/nearest_rotation.hpp>
#include <lie/detail/small_matrix.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <span>

namespace liestat {
namespace detail {

/// The bearing of an image point.
inline Eigen::Vector3d bearing(double x, double y) {
  const double inverse = 1 / std::sqrt(x * x + y * y + 1);
  return Eigen::Vector3d(inverse * x, inverse * y, inverse);
}

/// The rotation R with b_i nearest to R a_i for two pairs of unit vectors, to equal shares. False where the two
/// vectors of a pair are parallel to 1e-9.
inline bool rotationOfTwo(const Eigen::Vector3d& a1, const Eigen::Vector3d& a2, const Eigen::Vector3d& b1,
                          const Eigen::Vector3d& b2, Eigen::Matrix3d& R) {
  // Sum and difference of unit vectors are orthogonal: two of the axes of a frame.
  const Eigen::Vector3d sa = a1 + a2, da = a1 - a2, sb = b1 + b2, db = b1 - b2;
  const double nsa = sa.squaredNorm(), nda = da.squaredNorm(), nsb = sb.squaredNorm(), ndb = db.squaredNorm();
  if (!(std::min(std::min(nsa, nsb), std::min(nda, ndb)) > 1e-18)) return false;
  const Eigen::Vector3d ua = sa / std::sqrt(nsa), va = da / std::sqrt(nda), ub = sb / std::sqrt(nsb),
                        vb = db / std::sqrt(ndb), wa = ua.cross(va), wb = ub.cross(vb);
  for (int j = 0; j < 3; ++j) R.col(j) = ub * ua[j] + vb * va[j] + wb * wa[j];
  return R.allFinite();
}

}  // namespace detail

/// Rotation of the camera: least squares of the bearing vectors.
inline MatrixSolutions<1> solveRotation(std::span<const Eigen::Vector4d> matches) {
  MatrixSolutions<1> result;
  if (matches.size() < 2) return result;
  Eigen::Matrix3d R;
  if (matches.size() == 2) {
    const Eigen::Vector4d &m = matches[0], &k = matches[1];
    if (detail::rotationOfTwo(detail::bearing(m[0], m[1]), detail::bearing(k[0], k[1]), detail::bearing(m[2], m[3]),
                              detail::bearing(k[2], k[3]), R)) {
      result.add(R);
    }
    return result;
  }
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector4d& m : matches) M += detail::bearing(m[2], m[3]) * detail::bearing(m[0], m[1]).transpose();
  // The nearest rotation needs two singular values: the cofactors are of the size of their product.
  if (!(detail::cofactors(M).norm() > 1e-16 * M.squaredNorm())) return result;
  const Eigen::Vector4d q = detail::nearestQuaternion(M);
  R = Eigen::Quaterniond(q[3], q[0], q[1], q[2]).toRotationMatrix();
  if (R.allFinite()) result.add(R);
  return result;
}

/// Rotation of the camera whose focal length changes to r times the first, of exactly two matches: the angle between
/// the two rays is the same in both views, a quadratic equation for 1/r².
inline MatrixSolutions<2> solveRotationZoom(std::span<const Eigen::Vector4d> matches) {
  MatrixSolutions<2> result;
  if (matches.size() != 2) return result;
  const Eigen::Vector4d &m = matches[0], &k = matches[1];
  const Eigen::Vector3d a1 = detail::bearing(m[0], m[1]), a2 = detail::bearing(k[0], k[1]);
  // (κ b₁·b₂ + 1)² = c² (κ |b₁|² + 1)(κ |b₂|² + 1), c the cosine and κ = 1/r²; written with the squared sine s² = 1 -
  // c², which is small: κ² ((b₁·b₂)² - c² B₁ B₂) + κ (2 b₁·b₂ - c² (B₁ + B₂)) + s² = 0.
  const Eigen::Vector2d b1 = m.tail<2>(), b2 = k.tail<2>();
  const double s2 = a1.cross(a2).squaredNorm(), c = a1.dot(a2), cross = b1.x() * b2.y() - b1.y() * b2.x();
  const double B1 = b1.squaredNorm(), B2 = b2.squaredNorm();
  const double q2 = s2 * B1 * B2 - cross * cross, q1 = s2 * (B1 + B2) - (b1 - b2).squaredNorm(), q0 = s2;
  if (!(s2 > 1e-18) || !((b1 - b2).squaredNorm() > 1e-18 * (B1 + B2))) return result;
  const double discriminant = q1 * q1 - 4 * q2 * q0;
  if (!(discriminant >= 0)) return result;
  const double half = -0.5 * (q1 + (q1 >= 0 ? 1 : -1) * std::sqrt(discriminant));
  // One root as it is, the other by the product of both; where the leading coefficient vanishes, there is but one.
  const double roots[] = {q0 / half, half / q2};
  for (int i = 0; i < (discriminant > 0 ? 2 : 1); ++i) {
    const double kappa = roots[i];
    // The squared equation does not know the sign of the cosine.
    if (!(kappa > 0) || !std::isfinite(kappa) || !((kappa * b1.dot(b2) + 1) * c > 0)) continue;
    const double inverse = std::sqrt(kappa);
    Eigen::Matrix3d H;
    if (!detail::rotationOfTwo(a1, a2, detail::bearing(inverse * b1.x(), inverse * b1.y()),
                               detail::bearing(inverse * b2.x(), inverse * b2.y()), H)) {
      continue;
    }
    H.topRows<2>() /= inverse;
    if (H.allFinite()) result.add(H);
  }
  return result;
}

}  // namespace liestat
