// The minimisers of a closed form, side by side: which comes first, whether the data tell them apart, and their scale.
#pragma once

#include <fusion/init/detail/closed_form_solver.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace liestat::detail {

/// True if most of its features are in front of the camera.
inline bool isInFront(const MotionCandidate& c, const RayTable& table) { return 2 * c.negative < table.features(); }

/// Puts first the one whose features are in front of the camera, then the cheaper.
inline void order(std::vector<MotionCandidate>& candidates, const RayTable& table) {
  if (candidates.size() < 2) return;
  const bool first = isInFront(candidates[0], table), second = isInFront(candidates[1], table);
  if (first != second ? second : candidates[1].cost < candidates[0].cost) {
    std::swap(candidates[0], candidates[1]);
  }
}

/// True if the second minimiser explains the data as well as the first.
inline bool hasRival(const std::vector<MotionCandidate>& candidates) {
  return candidates.size() == 2 && candidates[1].cost - candidates[0].cost <= chi_squared_1_95;
}

/// Relative difference of the changes of gravity and bias up to which two minimisers are mirror images: the changes are
/// equal for exact data (docs/theory/visual_inertial.md, section 3.5), and noise moves each minimiser by itself.
inline constexpr double mirror_tolerance = 0.2;

/// True if the difference of the two gravities is that of the two biases.
inline bool isMirror(const std::vector<MotionCandidate>& candidates) {
  const Eigen::Vector3d G = candidates[1].y.gravity() - candidates[0].y.gravity();
  return (candidates[1].y.bias() - candidates[0].y.bias() - G).norm() < mirror_tolerance * G.norm();
}

/// The largest distance of the camera from t0 (m).
inline double farthest(const RayTable& table, const Motion& y) {
  double most = 0;
  for (const ScaledImage& image : table.images) {
    most = std::max(most, relativePosition(image, Eigen::Vector3d::Zero(), y).norm());
  }
  return most;
}

/// Scales V and the features so that these are in front of the camera, at a median distance of one.
inline void normaliseScale(MotionCandidate& c, const RayTable& table) {
  std::vector<double> distances;
  double front = 0;
  for (std::size_t i = 0; i < c.P.size(); ++i) {
    distances.push_back(c.P[i].norm());
    front += table.of(i).front().u.dot(c.P[i]);
  }
  const double factor = std::copysign(1 / median(distances), front);
  c.y.set(0, factor * c.y.velocity());
  for (Eigen::Vector3d& p : c.P) p *= factor;
}

}  // namespace liestat::detail
