// The definition of fusion/visual_inertial.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/init/detail/visual_inertial_run.hpp>
#include <fusion/visual_inertial.hpp>
#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/calibrate_noise.hpp>
#endif

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <vector>

namespace liestat {

namespace detail {

/// Tests the densities of the noise by all windows, estimates these anew where it refutes them, and fuses them.
inline void fuse(VisualInertialResult& result, const VisualInertialRecording& recording,
                 const VisualInertialOptions& options, const RecordingRun& run,
                 const std::function<void(std::size_t done, std::size_t all)>& progress) {
  std::vector<InitialisedWindow>& windows = result.windows;
  const bool known =
      std::any_of(windows.begin(), windows.end(), [](const InitialisedWindow& w) { return w.known_biases; });
  if (!options.calibrate_noise || !options.refinement || known || result.windows_left > 0) {
    result.stretches = run.fuse(windows);
    return;
  }
  // The densities are a hypothesis, which all meetings of the recording's windows test: what they say holds for each.
  std::vector<InitialisedWindow> starts = windows;
  result.noise_calibration = calibrateWindows(recording, run, starts, [&] {
    if (progress) progress(windows.size(), windows.size());
    return !(options.stop && options.stop());
  });
  const ImuNoise<double>& noise = result.noise_calibration->noise;
  const bool changed =
      noise.gyroscope != recording.noise.gyroscope || noise.accelerometer != recording.noise.accelerometer;
  const RecordingRun calibrated = run.withNoise(noise);
  for (std::size_t i = 0; changed && i < windows.size(); ++i) windows[i] = calibrated.withThisNoise(starts[i], i);
  result.stretches = calibrated.fuse(windows);
}

}  // namespace detail

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
  if (options.stretch > 0) detail::fuse(result, recording, options, run, progress);
  result.filter_start = filterStart(result, options.filter_start);
  return result;
}

LIESTAT_FUSION_INLINE FilterStart filterStart(const VisualInertialResult& result, const FilterStartOptions& options) {
  const auto last = [](const auto& list, const auto& property) {
    const auto found = std::find_if(list.rbegin(), list.rend(), property);
    return found == list.rend() ? nullptr : &*found;
  };
  const InitialisedWindow* rest = last(result.windows, [](const InitialisedWindow& w) {
    return w.verdict() == FusionStatus::stationary && w.isRefined() && w.refined->status == FusionStatus::stationary;
  });
  const FusedStretch* stretch = last(result.stretches, [](const FusedStretch& s) { return s.ok(); });
  const InitialisedWindow* window =
      last(result.windows, [](const InitialisedWindow& w) { return w.ok() && w.refined; });
  const auto startOf = [&](const InitialisedWindow& w) {
    Gaussian<InertialState> state = windowStates(*w.refined).last;
    if (&w == rest) {
      state.covariance.block<3, 3>(2, 2).diagonal().array() += options.rest_speed_sigma * options.rest_speed_sigma;
    }
    return filterStart(state, w.refined->gravity.norm(), w.end, options);
  };
  FilterStart start{.convention = options.convention};
  if (rest && (!stretch || rest->end > stretch->end)) {
    start = startOf(*rest);
    start.from_rest = true;
  } else if (stretch) {
    start = filterStart(stretch->state, stretch->gravity, stretch->end, options);
  } else if (last(result.stretches, [](const FusedStretch& s) { return s.tested(); })) {
    start.status = FilterStart::Status::inconsistent;
  } else if (window) {
    start = startOf(*window);
    if (start.ok()) start.status = FilterStart::Status::untested;
  }
  return start;
}

}  // namespace liestat
