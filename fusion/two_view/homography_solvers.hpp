// Closed-form solver for the homography of a plane, ũ' ~ H ũ, and the test of orientation. Which samples have no solution:
// fusion/two_view/solvers.hpp.
#pragma once

#include <fusion/two_view/detail/match_sums.hpp>
#include <fusion/two_view/detail/null_vectors.hpp>
#include <fusion/two_view/solutions.hpp>

#include <Eigen/Core>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

namespace liestat {
namespace detail {

/// Twice the area of the triangle of three points.
inline double area(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

}  // namespace detail

/// True if the two images show the triangles of the first four matches the same way round, as two views of one side of
/// a plane do; false also where three points are collinear in an image. A homography sample that fails is wrong, and
/// solveHomography gives no solution for it.
inline bool keepsOrientation(std::span<const Eigen::Vector4d> matches) {
  if (matches.size() < 3) return false;
  const Eigen::Vector4d a = matches[1] - matches[0], b = matches[2] - matches[0];
  const double d3 = detail::area(a.head<2>(), b.head<2>()), e3 = detail::area(a.tail<2>(), b.tail<2>());
  if (matches.size() == 3) return d3 * e3 > 0;
  const Eigen::Vector4d c = matches[3] - matches[0];
  const double d1 = detail::area(b.head<2>(), c.head<2>()), e1 = detail::area(b.tail<2>(), c.tail<2>());
  const double d2 = detail::area(c.head<2>(), a.head<2>()), e2 = detail::area(c.tail<2>(), a.tail<2>());
  // The fourth triangle, without the first point: the sum of the others.
  return d1 * e1 > 0 && d2 * e2 > 0 && d3 * e3 > 0 && (d1 + d2 + d3) * (e1 + e2 + e3) > 0;
}

namespace detail {

/// Four matches determine a homography: with p₀ as origin and [p₁ p₂ p₃] as basis of homogeneous coordinates,
/// H = Σ (e_i/d_i) p'_i (p_j × p_k)ᵀ, d_i = det(p₀, p_j, p_k), e_i the same in the second image.
inline bool homographyOfFour(std::span<const Eigen::Vector4d> m, Eigen::Matrix3d& H) {
  const Eigen::Vector4d p[3] = {m[1] - m[0], m[2] - m[0], m[3] - m[0]};
  double d[3], e[3], first = 0, second = 0;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector4d &q = p[(i + 1) % 3], &r = p[(i + 2) % 3];
    d[i] = q[0] * r[1] - q[1] * r[0];
    e[i] = q[2] * r[3] - q[3] * r[2];
    first = std::max(first, p[i].head<2>().squaredNorm());
    second = std::max(second, p[i].tail<2>().squaredNorm());
  }
  // Rounding of the coordinates counts as much as the extent.
  constexpr double rounding = 8 * std::numeric_limits<double>::epsilon();
  const double min_d = 1e-9 * first + rounding * std::sqrt(first) * m[0].head<2>().cwiseAbs().sum();
  const double min_e = 1e-9 * second + rounding * std::sqrt(second) * m[0].tail<2>().cwiseAbs().sum();
  const double d3 = d[0] + d[1] + d[2], e3 = e[0] + e[1] + e[2];
  bool good = std::abs(d3) > min_d && std::abs(e3) > min_e && d3 * e3 > 0;
  for (int i = 0; i < 3; ++i) {
    good = good && std::abs(d[i]) > min_d && std::abs(e[i]) > min_e && d[i] * e[i] > 0;
  }
  if (!good) return false;
  // With p_i = (x_i, 1) the rows are p_j × p_k = (y_j - y_k, x_k - x_j, d_i).
  H.setZero();
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector4d &q = p[(i + 1) % 3], &r = p[(i + 2) % 3];
    const double ratio = e[i] / d[i];
    const Eigen::Vector3d column(ratio * p[i][2], ratio * p[i][3], ratio);
    H.col(0) += (q[1] - r[1]) * column;
    H.col(1) += (r[0] - q[0]) * column;
    H.col(2) += d[i] * column;
  }
  // p₀ goes to p'₀ at the origin: the last column is (0, 0, h) but for rounding.
  H(0, 2) = H(1, 2) = 0;
  // Back from the origin: [I m'; 0 1] H [I -m; 0 1].
  H.col(2) -= m[0][0] * H.col(0) + m[0][1] * H.col(1);
  H.row(0) += m[0][2] * H.row(2);
  H.row(1) += m[0][3] * H.row(2);
  const double size = H.squaredNorm();
  // The first match lies in front of both views.
  const double side = H(2, 0) * m[0][0] + H(2, 1) * m[0][1] + H(2, 2);
  if (!(size > 0) || !std::isfinite(size)) return false;
  H *= (side < 0 ? -1 : 1) * std::sqrt(3 / size);
  return true;
}

}  // namespace detail

/// Homography of a plane: of four matches directly, of more by linear least squares after Hartley's normalisation (R.
/// Hartley, "In defense of the eight-point algorithm", PAMI 19, 1997). Its sign makes the third coordinate of H ũ
/// positive. None where an image shows the points collinear, or the two show them from different sides.
inline MatrixSolutions<1> solveHomography(std::span<const Eigen::Vector4d> matches) {
  MatrixSolutions<1> result;
  Eigen::Matrix3d H;
  if (matches.size() < 4) return result;
  if (matches.size() == 4) {
    if (detail::homographyOfFour(matches, H)) result.add(H);
    return result;
  }
  const detail::CentredMatches sums(matches);
  if (!sums.spread) return result;
  const double s = sums.scaleOf(sums.first, matches.size()), r = sums.scaleOf(sums.second, matches.size());
  // The rows of the equations are (0, -ũ, y' ũ) and (ũ, 0, -x' ũ): three sums of ũ ũᵀ make their normal matrix.
  Eigen::Matrix<double, 9, 9> A = Eigen::Matrix<double, 9, 9>::Zero();
  for (const Eigen::Vector4d& m : matches) {
    const Eigen::Vector3d u(s * (m[0] - sums.mean.x()), s * (m[1] - sums.mean.y()), 1);
    const double x = r * (m[2] - sums.mean_second.x()), y = r * (m[3] - sums.mean_second.y());
    const Eigen::Matrix3d square = u * u.transpose();
    A.block<3, 3>(0, 0) += square;
    A.block<3, 3>(6, 0) -= x * square;
    A.block<3, 3>(6, 3) -= y * square;
    A.block<3, 3>(6, 6) += (x * x + y * y) * square;
  }
  A.block<3, 3>(3, 3) = A.block<3, 3>(0, 0);
  Eigen::Matrix<double, 9, 1> h;
  if (!detail::leastVector<9>(A, h)) return result;
  H << h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], h[8];
  // A singular map takes the plane to a line: no view of it.
  if (!(std::abs(H.determinant()) > 1e-9)) return result;
  // u' = mean' + û'/r, û = s (u - mean).
  H.leftCols<2>() *= s;
  H.col(2) -= H.leftCols<2>() * sums.mean;
  H.topRows<2>() = (H.topRows<2>() / r + sums.mean_second * H.row(2)).eval();
  const double side = H(2, 0) * sums.mean.x() + H(2, 1) * sums.mean.y() + H(2, 2);
  H *= (side < 0 ? -1 : 1) * std::sqrt(3 / H.squaredNorm());
  if (H.allFinite() && H.determinant() > 0) result.add(H);
  return result;
}

}  // namespace liestat
