// The residual of a match of two images. In the axes of t0, with a translation along t, directions u of the first and
// u' of the second,
//   r = t·(u × u') / s,    s² = σ² |u' × t|² + σ'² |u × t|²,
// is a residual of variance one to first order (Kneip's and Lynen's normal epipolar constraint, with the noise of the
// normal).
#pragma once

#include <fusion/init/detail/epipolar_matches.hpp>

#include <Eigen/Core>

#include <cmath>

namespace liestat::detail {

/// A residual with its derivatives by the translation and by turning the second image.
struct EpipolarRow {
  double value, scale;
  Eigen::Vector3d by_t, by_turn;
};

/// s². Straight ahead, within some sigmas of the translation, a normal has no direction: it counts for less.
inline double varianceAlong(const EpipolarSight& a, const EpipolarSight& b, const Eigen::Vector3d& t) {
  const double x = a.u.dot(t), y = b.u.dot(t);
  return a.variance * (1 - y * y) + b.variance * (1 - x * x) + 100 * a.variance * b.variance;
}
/// The residual of a match for a translation along t.
inline EpipolarRow rowOf(const EpipolarSight& a, const EpipolarSight& b, const Eigen::Vector3d& t) {
  EpipolarRow row;
  const Eigen::Vector3d n = a.u.cross(b.u);
  const double x = a.u.dot(t), y = b.u.dot(t);
  row.scale = 1 / std::sqrt(varianceAlong(a, b, t));
  row.value = row.scale * t.dot(n);
  // s depends on t and on the turn of u' too.
  const double back = row.scale * row.value;
  row.by_t = row.scale * (n + back * (a.variance * y * b.u + b.variance * x * a.u));
  row.by_turn = row.scale * (a.u.dot(b.u) * t - y * a.u + (back * a.variance * y) * b.u.cross(t));
  return row;
}

/// The inverse of a symmetric positive definite 3×3 matrix; false where it is not, to rounding.
inline bool invertPositive(const Eigen::Matrix3d& H, Eigen::Matrix3d& inverse) {
  const Eigen::Vector3d a = H.col(1).cross(H.col(2)), b = H.col(2).cross(H.col(0)), c = H.col(0).cross(H.col(1));
  const double determinant = H.col(0).dot(a), trace = H.trace();
  if (!(H(0, 0) > 0 && c.z() > 0 && determinant > 1e-14 * trace * trace * trace)) return false;
  inverse << a, b, c;
  inverse /= determinant;
  return std::isfinite(determinant);
}

}  // namespace liestat::detail
