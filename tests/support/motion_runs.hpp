// A filter of fusion/motion/ run over simulated scenes, and what came of it.
#pragma once

#include <experiments/motion_scene.hpp>
#include <fusion/motion/types.hpp>
#include <lie/manifold.hpp>
#include <lie/units.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace liestat::tests {

using experiments::MotionScene;
using experiments::MotionSceneOptions;
using experiments::MotionWorld;

using units::degree;

/// The true direction of what an estimate is about.
inline S2d truthOf(const MotionScene& scene, const MotionEstimate& estimate) {
  return S2d(estimate.meaning == DirectionMeaning::velocity ? scene.velocity : scene.translation);
}
/// Error of the direction (degrees).
inline double errorOf(const MotionScene& scene, const MotionEstimate& estimate) {
  return distance(estimate.direction.mean, truthOf(scene, estimate)) / degree;
}

template <class Filter>
const MotionEstimate& updated(Filter& filter, const MotionScene& scene) {
  return scene.hasGyroscope() ? filter.update(scene.pairs, scene.gyroscope) : filter.update(scene.pairs);
}

/// After `frames` frames of so many trials: errors (degrees, sorted), successes (below 10°), their consistency
/// ξᵀ P⁻¹ ξ/2, and how often an estimate that was called usable was wrong.
struct MotionRuns {
  std::vector<double> errors;
  std::size_t successes = 0, usable = 0, wrong_usable = 0;
  double consistency = 0;
  double success() const { return static_cast<double>(successes) / static_cast<double>(errors.size()); }
  double median() const { return errors[errors.size() / 2]; }
};

/// make(trial) makes a filter.
template <class Make>
MotionRuns runMotion(const MotionSceneOptions& scenes, std::size_t trials, int frames, const Make& make) {
  MotionRuns runs;
  for (std::uint64_t trial = 0; trial < trials; ++trial) {
    MotionScene scene(scenes, 20, trial);
    auto filter = make(trial);
    for (int k = 0; k < frames; ++k) {
      scene.advance();
      updated(filter, scene);
    }
    const MotionEstimate& e = filter.estimate();
    const double error = errorOf(scene, e);
    runs.errors.push_back(error);
    runs.usable += e.ok() ? 1U : 0U;
    runs.wrong_usable += e.ok() && error >= 10 ? 1U : 0U;
    if (error >= 10) continue;
    ++runs.successes;
    runs.consistency += mahalanobisSquared(e.direction, truthOf(scene, e)) / 2;
  }
  runs.consistency /= static_cast<double>(std::max<std::size_t>(runs.successes, 1));
  std::sort(runs.errors.begin(), runs.errors.end());
  return runs;
}

}  // namespace liestat::tests
