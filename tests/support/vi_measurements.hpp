// What an inertial sensor measures of a scene.
#pragma once

#include <fusion/preintegrate.hpp>
#include <support/vi_scene.hpp>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat_test {

/// What an inertial sensor at 200 Hz reads, with the scene's bias of the accelerometer and one of the gyroscope.
inline std::vector<liestat::ImuSample<double>> readingsOf(
    const Scene& scene, const liestat::ImuNoise<double>& noise, SceneRandom& random,
    const Eigen::Vector3d& gyroscope_bias = Eigen::Vector3d::Zero()) {
  constexpr double step = 0.005;
  std::vector<liestat::ImuSample<double>> readings;
  for (int k = 0; k <= static_cast<int>(scene.options().window / step) + 1; ++k) {
    readings.push_back(scene.reading(k * step));
    readings.back().angular_rate += noise.gyroscope / std::sqrt(step) * random.normal3() + gyroscope_bias;
    readings.back().specific_force += noise.accelerometer / std::sqrt(step) * random.normal3() + scene.options().bias;
  }
  return readings;
}

/// The motions from each image of a scene to the next.
inline std::vector<liestat::Preintegration<double>> motionsOf(const Scene& scene,
                                                              const std::vector<liestat::ImuSample<double>>& readings,
                                                              const liestat::RecordingOptions<double>& options = {}) {
  std::vector<liestat::Preintegration<double>> motions;
  for (std::size_t j = 1; j < scene.times.size(); ++j) {
    motions.push_back(liestat::preintegrate<double>(readings, scene.times[j - 1], scene.times[j], options).motion);
  }
  return motions;
}

/// Replaces what the images know of the motion by what an inertial sensor at 200 Hz measures of it.
inline void measure(Scene& scene, const liestat::ImuNoise<double>& noise, SceneRandom& random) {
  const auto motions = motionsOf(scene, readingsOf(scene, noise, random));
  liestat::Preintegration<double> whole;
  for (std::size_t j = 1; j < scene.times.size(); ++j) {
    whole = whole * motions[j - 1];
    scene.window.images[j] = liestat::windowImage(whole);
    scene.window.images[j].time = scene.times[j];
  }
}

}  // namespace liestat_test
