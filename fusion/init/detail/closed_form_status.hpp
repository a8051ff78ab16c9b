// Which case of docs/theory/visual_inertial.md, section 4, a window is, from exact ranks or from noise.
#pragma once

#include <fusion/init/detail/closed_form_solver.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <vector>

namespace liestat::detail {

/// Dimension of the null space for a general motion and layout, all features seen by n images.
inline int genericNullDimension(std::size_t images, std::size_t features, bool bias) {
  const bool one = features == 1;
  if (images < 3) return bias ? 7 : (one ? 5 : 4);
  if (!bias) return images == 3 ? (one ? 3 : 1) : images == 4 && one ? 1 : 0;
  if (images == 3) return one ? 6 : 4;
  if (images == 4) return one ? 4 : 1;
  return images == 5 && one ? 2 : 0;
}

/// The largest sine of the angle between a direction and the plane that holds them best, over the direction's relative
/// sigma; 0 for fewer than three.
inline double outOfPlane(const std::vector<Ray>& rays) {
  // The normal of the two that differ most from the first and from one another: nothing is squared.
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (const Ray& ray : rays) {
    const Eigen::Vector3d n = rays.front().u.cross(ray.u);
    if (n.squaredNorm() > normal.squaredNorm()) normal = n;
  }
  if (normal.norm() == 0) return 0;
  normal.normalize();
  double most = 0;
  for (const Ray& ray : rays) most = std::max(most, ray.precision * std::abs(normal.dot(ray.u)));
  return most;
}

/// True if a window of this size may lose rank by coplanarity: with more it is harmless.
inline bool coplanarityMatters(std::size_t images, std::size_t features) {
  return (features == 1 && images < 6) || (features == 2 && images == 3);
}

/// The parts of the motion that its null vectors move.
struct NullShape {
  int gravity_rank = 0;         ///< how many directions of G they move
  bool bias_is_gravity = true;  ///< all are changes of the bias that gravity makes up for, V at rest
};

inline NullShape nullShape(const RankDiagnosis& d) {
  constexpr double zero = 1e-6;
  NullShape shape;
  shape.bias_is_gravity = d.motion_null > 0 && d.vectors.front().hasBias();
  Eigen::Vector3d moved[3];
  for (std::size_t k = d.vectors.size() - static_cast<std::size_t>(d.motion_null); k < d.vectors.size(); ++k) {
    const Motion& y = d.vectors[k];
    const Eigen::Vector3d G = y.gravity();
    // At most three are independent: what a fourth adds, the others hold already.
    Eigen::Vector3d rest = G;
    for (int j = 0; j < shape.gravity_rank; ++j) rest -= moved[j].dot(rest) * moved[j];
    if (shape.gravity_rank < 3 && rest.norm() > zero) moved[shape.gravity_rank++] = rest.normalized();
    shape.bias_is_gravity =
        shape.bias_is_gravity && y.velocity().norm() <= zero && (y.bias() - G).norm() <= 1e-4 * G.norm();
  }
  return shape;
}

/// How far the camera moves from its first place according to a motion, relative to what gravity alone would do.
inline double relativeMotion(const RayTable& table, const Motion& y) {
  double most = 0;
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero(), first = relativePosition(table.images.front(), zero, y);
  for (const ScaledImage& image : table.firstCamera()) {
    most = std::max(most, (relativePosition(image, zero, y) - first).norm());
  }
  return most / y.gravity().norm();
}

/// The case of exact data before anything is solved; `ok` where what follows depends on the solutions.
inline FusionStatus statusOfRanks(const RankDiagnosis& d, const RayTable& table, std::size_t images,
                                  bool gravity_known) {
  using Status = FusionStatus;
  const std::size_t features = table.features();
  const bool bias = d.vectors.front().hasBias();
  const int generic = genericNullDimension(images, features, bias);
  const NullShape shape = nullShape(d);
  if (generic >= 2) return Status::too_few_images;
  if (shape.bias_is_gravity) {
    if (d.motion_null > 1) return Status::bias_unobservable;
    return gravity_known ? Status::mirror_gravity : Status::gravity_undetermined;
  }
  const bool parallax = std::any_of(d.feature_rank.begin(), d.feature_rank.end(), [](int rank) { return rank == 3; });
  if (!parallax) return d.motion_null == 0 ? Status::stationary : Status::no_parallax;
  const int null = d.motion_null + d.feature_null;
  const bool planar = outOfPlane(table.rays) < 1e-9;
  if (d.motion_null == 0) return Status::ok;
  if (d.motion_null == 1 && shape.gravity_rank == 0) return Status::scale_unobservable;
  if (d.motion_null > shape.gravity_rank) return bias ? Status::bias_unobservable : Status::gravity_undetermined;
  if (planar && null > generic && coplanarityMatters(images, features)) return Status::coplanar;
  if (d.motion_null > 1) return bias ? Status::bias_unobservable : Status::gravity_undetermined;
  return gravity_known ? Status::ambiguous : Status::gravity_undetermined;
}

/// G T²/2 of a body that stays where it is, if the forces are that: their length gravity's to 2 %, or to four standard
/// deviations of the accelerometer's bias (m/s²), and their direction steady to 1 %. Without the sensor's noise more can't
/// be asked here: refineAtRest() does.
inline std::optional<Eigen::Vector3d> gravityAtRest(const RayTable& table, const std::optional<double>& gravity,
                                                    double scale, double bias_sigma) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double squares = 0;
  for (const ScaledImage& image : table.firstCamera()) {
    const double t = image.tau * image.tau;
    sum -= t * (image.s - table.images[0].s);
    squares += t * t;
  }
  const Eigen::Vector3d G = sum / squares;
  const double length = G.norm(), expected = gravity ? *gravity / scale : length;
  const double bias = std::isfinite(bias_sigma) ? 4 * bias_sigma / scale : 0;
  if (!(std::abs(length - expected) <= std::max(0.02 * expected, bias))) return std::nullopt;
  for (const ScaledImage& image : table.firstCamera()) {
    const Eigen::Vector3d moved = image.s - table.images[0].s + image.tau * image.tau * G;
    if (!(moved.norm() <= 0.01 * expected)) return std::nullopt;
  }
  return expected / length * G;
}

/// Angle between the gravities of two minimisers.
inline double gravityAngle(const MotionCandidate& a, const MotionCandidate& b) {
  const Eigen::Vector3d x = a.y.gravity(), y = b.y.gravity();
  return std::atan2(x.cross(y).norm(), x.dot(y));
}

}  // namespace liestat::detail
