// The front door of visual-inertial initialisation: a recording of an inertial sensor and of tracks in the images of
// one or several cameras in, and out of it window by window velocity, gravity, scale and biases, what disjoint windows
// say together, and what of it is to be trusted.
//
//   liestat::VisualInertialRecording recording{.readings = readings, .noise = noise, .image_times = times,
//                                              .cameras = {body_T_camera}};
//   recording.observations = liestat::bearingsOf(pixels, {&camera, 1}, 1.);  // 1 pixel of noise; or your bearings
//   const auto result = liestat::initialiseRecording(recording, {});
//   for (const auto& window : result.windows) {
//     if (window.ok()) … window.refined->velocity(), window.refined->gravity, window.refined->covariance
//   }
//   … result.stretches: the state at the end of each, with its covariance
//
// Windows slide over the recording. Each is initialised by itself (robust_initialisation.hpp), refined (refinement.hpp)
// and, where windows are disjoint, fused with its neighbours (window_fusion.hpp). Nothing throws: what is wrong with
// the input is a fault of the result or of a window. Source: the design note on visual-inertial initialisation.
#pragma once

#include <fusion/detail/visual_inertial_run.hpp>
#include <fusion/visual_inertial_types.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

namespace liestat {

/// Slides windows over a recording. progress(done, all), where given, counts windows.
inline VisualInertialResult initialiseRecording(
    const VisualInertialRecording& recording, const VisualInertialOptions& options,
    const std::function<void(std::size_t done, std::size_t all)>& progress = {}) {
  VisualInertialResult result;
  const std::vector<double>& times = recording.image_times;
  const auto disorder =
      std::adjacent_find(times.begin(), times.end(), [](double before, double after) { return !(after > before); });
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  if (!positive(options.window) || !(options.stride >= 0) || !(options.image_rate >= 0) || disorder != times.end() ||
      !positive(recording.noise.gyroscope) || !positive(recording.noise.accelerometer)) {
    result.fault = FaultKind::bad_option;
    return result;
  }
  const detail::RecordingRun run(recording, options, result);
  if (result.fault) return result;
  if (times.empty() || recording.readings.empty()) {
    result.fault = FaultKind::too_few_images;
    return result;
  }
  const double begin = options.begin.value_or(times.front()), end = options.end.value_or(times.back());
  if (!((end - begin) / run.stride() < static_cast<double>(options.max_windows))) {
    result.fault = FaultKind::bad_option;
    return result;
  }
  const std::vector<std::vector<std::size_t>> windows = run.windows();
  if (windows.empty()) result.fault = FaultKind::too_few_images;
  ImuBias<double> bias = options.initialisation.prior.mean;
  for (const std::vector<std::size_t>& images : windows) {
    if (progress) progress(result.windows.size(), windows.size());
    result.windows.push_back(run.estimate(images, bias, result.windows.size()));
    // Biases hardly change from window to window.
    const InitialisedWindow& w = result.windows.back();
    if (!w.known_biases && w.ok() && w.refined) bias = w.refined->bias;
  }
  if (options.stretch > 0) result.stretches = run.fuse(result.windows);
  return result;
}

}  // namespace liestat
