// What an inertial sensor measures of a scene.
#pragma once

#include <fusion/preintegrate.hpp>
#include <support/vi_scene.hpp>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat_test {

/// Replaces what the images know of the motion by what an inertial sensor at 200 Hz measures of it.
inline void measure(Scene& scene, const liestat::ImuNoise<double>& noise, SceneRandom& random) {
  constexpr double step = 0.005;
  std::vector<liestat::ImuSample<double>> readings;
  for (int k = 0; k <= static_cast<int>(scene.options().window / step) + 1; ++k) {
    readings.push_back(scene.reading(k * step));
    readings.back().angular_rate += noise.gyroscope / std::sqrt(step) * random.normal3();
    readings.back().specific_force += noise.accelerometer / std::sqrt(step) * random.normal3() + scene.options().bias;
  }
  liestat::Preintegration<double> whole;
  for (std::size_t j = 1; j < scene.times.size(); ++j) {
    whole = whole * liestat::preintegrate<double>(readings, scene.times[j - 1], scene.times[j]).motion;
    scene.window.images[j] = liestat::windowImage(whole);
    scene.window.images[j].time = scene.times[j];
  }
}

}  // namespace liestat_test
