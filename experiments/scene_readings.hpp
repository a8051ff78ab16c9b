// The readings that an inertial sensor takes of a simulated scene (experiments/inertial_scene.hpp), and its window.
//
//   const auto readings = liestat::readingsOf(scene, noise, random, gyroscope_bias);
//   const auto window = liestat::experiments::windowOf(scene, readings, {.preintegration = {.noise = noise}});
#pragma once

#include <fusion/imu/readings.hpp>
#include <experiments/inertial_scene.hpp>
#include <fusion/imu/preintegrate.hpp>
#include <fusion/imu/preintegration.hpp>
#include <fusion/imu/window.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat::experiments {

/// The readings of an inertial sensor from the first image to beyond the last, `rate` a second: with white noise, the
/// scene's bias of the accelerometer (InertialSceneOptions::bias) and one of the gyroscope (rad/s). Biases do not walk.
inline std::vector<ImuSample<double>> readingsOf(const InertialScene& scene, const ImuNoise<double>& noise,
                                                 CounterRng& random,
                                                 const Eigen::Vector3d& gyroscope_bias = Eigen::Vector3d::Zero(),
                                                 double rate = 200) {
  const double step = 1 / rate;
  std::vector<ImuSample<double>> readings;
  for (int k = 0; k <= static_cast<int>(scene.options().window / step) + 1; ++k) {
    readings.push_back(scene.reading(k * step));
    readings.back().angular_rate += noise.gyroscope / std::sqrt(step) * random.normalVector<3>() + gyroscope_bias;
    readings.back().specific_force +=
        noise.accelerometer / std::sqrt(step) * random.normalVector<3>() + scene.options().bias;
  }
  return readings;
}

/// Lets the biases of readings walk from the first on, with the densities of the noise; what they have walked to at
/// each reading.
inline std::vector<ImuBias<double>> addWalk(std::vector<ImuSample<double>>& readings, const ImuNoise<double>& noise,
                                            CounterRng& random) {
  std::vector<ImuBias<double>> walked(readings.size());
  for (std::size_t k = 1; k < readings.size(); ++k) {
    const double root = std::sqrt(readings[k].time - readings[k - 1].time);
    walked[k].gyroscope = walked[k - 1].gyroscope + noise.gyroscope_walk * root * random.normalVector<3>();
    walked[k].accelerometer = walked[k - 1].accelerometer + noise.accelerometer_walk * root * random.normalVector<3>();
    readings[k].angular_rate += walked[k].gyroscope;
    readings[k].specific_force += walked[k].accelerometer;
  }
  return walked;
}

/// A scene's window with these readings.
inline InertialWindow windowOf(const InertialScene& scene, const std::vector<ImuSample<double>>& readings,
                               const RecordingOptions<double>& options = {}) {
  return {readings, scene.times, options, scene.window.features, scene.window.cameras};
}

/// The motions from each image of a scene to the next.
inline std::vector<Preintegration<double>> motionsOf(const InertialScene& scene,
                                                     const std::vector<ImuSample<double>>& readings,
                                                     RecordingOptions<double> options = {}) {
  options.chained = true;
  std::vector<Preintegration<double>> motions;
  for (std::size_t j = 1; j < scene.times.size(); ++j) {
    motions.push_back(preintegrate<double>(readings, scene.times[j - 1], scene.times[j], options).motion);
  }
  return motions;
}

/// Replaces what the images of a scene's window know of the motion by what an inertial sensor at 200 Hz measures of it.
inline void measure(InertialScene& scene, const ImuNoise<double>& noise, CounterRng& random) {
  const auto motions = motionsOf(scene, readingsOf(scene, noise, random));
  Preintegration<double> whole;
  for (std::size_t j = 1; j < scene.times.size(); ++j) {
    whole = whole * motions[j - 1];
    scene.window.images[j] = windowImage(whole);
    scene.window.images[j].time = scene.times[j];
  }
}

}  // namespace liestat::experiments
