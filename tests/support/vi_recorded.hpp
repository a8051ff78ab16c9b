// A scene as a camera with noise and tracks that drift and an inertial sensor with a gyroscope's bias record it.
#pragma once

#include <fusion/imu/window.hpp>
#include <support/vi_measurements.hpp>
#include <support/vi_scene.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace liestat_test {

struct RecordedOptions {
  SceneOptions scene = {};
  double bias = 0;                       ///< rad/s, of the gyroscope, in a random direction
  double sigma = 1. / 450;               ///< rad, of a bearing
  liestat::ImuNoise<double> noise = {};  ///< that readings have, and motions are integrated with
  double spread = 1;                     ///< bearings have relative deviations between 1/spread and spread
  std::size_t drifting = 0;              ///< the first tracks walk away,
  double drift = 8. / 450;               ///< rad, by so much an image in each direction
};

struct RecordedScene {
  RecordedOptions options;
  Scene scene;
  std::vector<liestat::ImuSample<double>> readings;
  Eigen::Vector3d bias;
  liestat::InertialWindow window;

  RecordedScene(const RecordedOptions& o, std::uint64_t seed) : options(o), scene(o.scene, seed) {
    CounterRng random(seed, 0, 1);
    bias = o.bias * random.unitVector<3>();
    readings = readingsOf(scene, o.noise, random, bias);
    for (liestat::FeatureTrack& track : scene.window.features) {
      for (liestat::TrackedBearing& seen : track) {
        seen.relative_sigma = o.spread == 1 ? 1 : std::pow(o.spread, random.uniform(-1, 1));
        const Eigen::Vector3d noise = o.sigma * seen.relative_sigma * random.normalVector<3>();
        seen.bearing = (seen.bearing + noise - seen.bearing.dot(noise) * seen.bearing).normalized();
      }
    }
    scene.addDrift(o.drifting, o.drift, random);
    window = windowOf(scene, readings, {.preintegration = {.noise = options.noise}});
  }
};

inline double quantileOf(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[static_cast<std::size_t>(p * static_cast<double>(values.size() - 1))];
}

}  // namespace liestat_test
