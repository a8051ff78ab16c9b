// Closed-form solvers for motions between two images that are told by a homography, ũ' ~ H ũ, ũ = (u, 1).
//
// A match is (u.x, u.y, u'.x, u'.y) in normalised coordinates, u = (p - c)/f; those that know nothing of the camera
// (retinal translation to homography) take any coordinates. Each takes its minimal number of matches or more; with more
// it solves linear or closed-form least squares, a start for an estimator that knows the noise of each match.
//
//   matches  solver                       H
//   1        solveRetinalTranslation      [I τ; 0 1]
//   1        solveZoom                    diag(s, s, 1): about the centre c of the image; s > 0
//   2        solveRetinalDisplacement     [Q τ; 0 1], Q a turn in the image
//   2        solveFreeZoom                [s I τ; 0 1], s > 0
//   2        solveSimilarity              [s Q τ; 0 1], s > 0
//   3        solveAffine                  [A τ; 0 1], det A > 0
//   2        solveRotation                R: the camera turns
//   2        solveRotationZoom            diag(r, r, 1) R: it turns and its focal length changes by r; up to two, no
//                                         more than two matches
//   4        solveHomography              any, det H > 0, ‖H‖² = 3
//
// A solver gives no solution for a sample that does not determine it, told without a scale: points that agree to
// sixteen roundings of their coordinates where two are needed; a triangle whose area is below 1e-9 of the square of the
// sample's extent (affine, homography); bearings within 1e-9 rad (rotation); not finite; fewer matches than needed.
#pragma once

#include <fusion/detail/match_sums.hpp>
#include <fusion/detail/null_vectors.hpp>
#include <fusion/two_view/solutions.hpp>
#include <lie/detail/nearest_rotation.hpp>
#include <lie/detail/small_matrix.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
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

/// Twice the area of the triangle of three points.
inline double area(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

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
  const double s2 = a1.cross(a2).squaredNorm(), c = a1.dot(a2), cross = detail::area(b1, b2);
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

/// Whether the two images show the triangles of the first four matches the same way round, as two views of one side of
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
  const double least_d = 1e-9 * first + rounding * std::sqrt(first) * m[0].head<2>().cwiseAbs().sum();
  const double least_e = 1e-9 * second + rounding * std::sqrt(second) * m[0].tail<2>().cwiseAbs().sum();
  const double d3 = d[0] + d[1] + d[2], e3 = e[0] + e[1] + e[2];
  bool good = std::abs(d3) > least_d && std::abs(e3) > least_e && d3 * e3 > 0;
  for (int i = 0; i < 3; ++i) {
    good = good && std::abs(d[i]) > least_d && std::abs(e[i]) > least_e && d[i] * e[i] > 0;
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
