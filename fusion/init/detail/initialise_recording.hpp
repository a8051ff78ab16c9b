// The definition of fusion/visual_inertial.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/init/detail/visual_inertial_run.hpp>
#include <fusion/visual_inertial.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

namespace liestat {

LIESTAT_FUSION_INLINE VisualInertialResult
initialiseRecording(const VisualInertialRecording& recording, const VisualInertialOptions& options,
                    const std::function<void(std::size_t done, std::size_t all)>& progress) {
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
    if (options.stop && options.stop()) {
      result.windows_left = windows.size() - result.windows.size();
      break;
    }
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
