// Closed-form solvers for motions of the image as a whole, ũ' ~ H ũ with a last row (0, 0, 1): translation to affine map.
// Which samples have no solution: fusion/two_view/solvers.hpp.
#pragma once

#include <fusion/two_view/detail/match_sums.hpp>
#include <fusion/two_view/solutions.hpp>

#include <Eigen/Core>
#include <Eigen/LU>

#include <cmath>
#include <span>

namespace liestat {
namespace detail {

/// The homography with the given upper two rows.
inline Eigen::Matrix3d affineMap(const Eigen::Matrix2d& A, const Eigen::Vector2d& shift) {
  Eigen::Matrix3d H;
  H << A(0, 0), A(0, 1), shift.x(), A(1, 0), A(1, 1), shift.y(), 0, 0, 1;
  return H;
}

/// The scale s > 0 of b = s a by total least squares, which both images' noise enters alike: min Σ|b - s a|²/(1 + s²).
inline double commonScale(double a_a, double b_b, double a_b) {
  const double half = 0.5 * (b_b - a_a), root = std::sqrt(half * half + a_b * a_b);
  // The form without cancellation of (half + root)/a_b.
  return half > 0 ? (half + root) / a_b : a_b / (root - half);
}

}  // namespace detail

/// Translation of the image: the mean difference.
inline MatrixSolutions<1> solveRetinalTranslation(std::span<const Eigen::Vector4d> matches) {
  MatrixSolutions<1> result;
  if (matches.empty()) return result;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (const Eigen::Vector4d& m : matches) sum += m.tail<2>() - m.head<2>();
  sum /= static_cast<double>(matches.size());
  if (sum.allFinite()) result.add(detail::affineMap(Eigen::Matrix2d::Identity(), sum));
  return result;
}

/// Zoom about the centre, by total least squares. None where the points lie at the centre, or on opposite sides of it.
inline MatrixSolutions<1> solveZoom(std::span<const Eigen::Vector4d> matches) {
  MatrixSolutions<1> result;
  double a_a = 0, b_b = 0, a_b = 0;
  for (const Eigen::Vector4d& m : matches) {
    a_a += m.head<2>().squaredNorm();
    b_b += m.tail<2>().squaredNorm();
    a_b += m.head<2>().dot(m.tail<2>());
  }
  if (!(a_b > 0) || !std::isfinite(a_a + b_b)) return result;
  const double s = detail::commonScale(a_a, b_b, a_b);
  if (s > 0 && std::isfinite(s))
    result.add(detail::affineMap(s * Eigen::Matrix2d::Identity(), Eigen::Vector2d::Zero()));
  return result;
}

namespace detail {

/// Turn and scale about the means: scaled, by a turn or not.
inline MatrixSolutions<1> solvePlaneSimilarity(std::span<const Eigen::Vector4d> matches, bool turns, bool scales) {
  MatrixSolutions<1> result;
  if (matches.size() < 2) return result;
  const CentredMatches sums(matches);
  if (!sums.spread) return result;
  double c = sums.mixed.trace(), s = turns ? sums.mixed(1, 0) - sums.mixed(0, 1) : 0;
  const double size = std::sqrt(c * c + s * s), scale_of_sums = std::sqrt(sums.first.trace() * sums.second.trace());
  // Where these vanish every turn does as well as any other; without a turn the scale must be positive.
  if (!(size > 1e-12 * scale_of_sums) || (!turns && !(c > 0))) return result;
  c /= size;
  s /= size;
  const double scale = scales ? commonScale(sums.first.trace(), sums.second.trace(), size) : 1;
  const Eigen::Matrix2d A = scale * (Eigen::Matrix2d() << c, -s, s, c).finished();
  if (A.allFinite() && scale > 0) result.add(affineMap(A, sums.mean_second - A * sums.mean));
  return result;
}

}  // namespace detail

/// Displacement of the image, a turn and a translation: least squares, symmetric in the two images.
inline MatrixSolutions<1> solveRetinalDisplacement(std::span<const Eigen::Vector4d> matches) {
  return detail::solvePlaneSimilarity(matches, true, false);
}
/// Zoom about any point, by total least squares.
inline MatrixSolutions<1> solveFreeZoom(std::span<const Eigen::Vector4d> matches) {
  return detail::solvePlaneSimilarity(matches, false, true);
}
/// Turn, zoom and translation of the image, by total least squares.
inline MatrixSolutions<1> solveSimilarity(std::span<const Eigen::Vector4d> matches) {
  return detail::solvePlaneSimilarity(matches, true, true);
}

/// Affine map, by least squares in the second image. None where it turns the image over.
inline MatrixSolutions<1> solveAffine(std::span<const Eigen::Vector4d> matches) {
  MatrixSolutions<1> result;
  if (matches.size() < 3) return result;
  const detail::CentredMatches sums(matches);
  if (!sums.spread) return result;
  Eigen::Matrix2d mixed = sums.mixed, moments = sums.first;
  double determinant = moments.determinant(), least = 1e-18 * moments.trace() * moments.trace();
  if (matches.size() == 3) {
    // The differences themselves, not their squares.
    const Eigen::Vector4d a = matches[1] - matches[0], b = matches[2] - matches[0];
    moments << a[0], b[0], a[1], b[1];
    mixed << a[2], b[2], a[3], b[3];
    least = 1e-9 * moments.squaredNorm();
    determinant = moments.determinant();
  }
  // The determinant is the square of an area, or an area.
  if (!(std::abs(determinant) > least)) return result;
  Eigen::Matrix2d adjugate;
  adjugate << moments(1, 1), -moments(0, 1), -moments(1, 0), moments(0, 0);
  const Eigen::Matrix2d A = mixed * adjugate / determinant;
  if (A.allFinite() && A.determinant() > 1e-9 * A.squaredNorm())
    result.add(detail::affineMap(A, sums.mean_second - A * sums.mean));
  return result;
}

}  // namespace liestat
