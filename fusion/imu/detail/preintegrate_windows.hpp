#pragma once

#include <fusion/imu/factor.hpp>
#include <fusion/imu/recording_windows.hpp>

#include <algorithm>
#include <cmath>

namespace liestat {

LIESTAT_FUSION_INLINE std::vector<TimeInterval> consecutiveWindows(double begin, double end,
                                                                   std::optional<double> length, double max_count) {
  if (!(end > begin) || !std::isfinite(end - begin)) return {};
  if (!length) return {{begin, end}};
  // The last window is a whole one; rounding must not take it away.
  const double fit = (end - begin) / *length * (1 + 1e-12);
  if (!(fit >= 1 && fit <= max_count)) return {};
  std::vector<TimeInterval> windows(static_cast<std::size_t>(fit));
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const double from = begin + static_cast<double>(i) * *length;
    windows[i] = {from, from + *length};
  }
  return windows;
}

LIESTAT_FUSION_INLINE RecordingWindow preintegrateWindow(std::span<const ImuSample<double>> readings,
                                                         const TimeInterval& window, std::span<const GroundTruth> truth,
                                                         const RecordingWindowOptions& options) {
  RecordingWindow w;
  w.begin = window.begin, w.end = window.end;
  const auto first = truthAt(truth, w.begin), last = truthAt(truth, w.end);
  w.bias = options.bias.value_or(first ? first->bias : ImuBias<double>{});
  RecordingOptions<double> how = options.integration;
  how.preintegration.bias = w.bias;
  w.result = preintegrate<double>(readings, w.begin, w.end, how);
  if (const Fault& fault = w.result.fault; fault && fault.index < readings.size()) {
    w.fault_time = readings[fault.index].time;
    if (fault.index > 0) w.time_before_fault = readings[fault.index - 1].time;
  }
  if (w.ok() && first && last) {
    const Eigen::Vector3d gravity(0, 0, -options.gravity);
    const auto [from, to] =
        statesInFixedAxes<double>(first->state, last->state, w.result.motion.duration(), gravity, options.world_rate);
    w.error = preintegrationError<double>(w.result.motion, from, to, w.bias, gravity);
    const ImuNoise<double>& noise = how.preintegration.noise;
    if (noise.gyroscope > 0 && noise.accelerometer > 0) {
      w.squared_distance = mahalanobisSquared<double, 9>(*w.error, w.result.motion.gaussian().covariance);
    }
  }
  const ImuNoise<double>& noise = how.preintegration.noise;
  if (w.ok() && options.world_rate.isZero() && noise.gyroscope > 0 && noise.accelerometer > 0) {
    constexpr double earth = 7.292115e-5;  // rad/s
    const double angle = earth * w.result.motion.duration();
    const Eigen::Matrix<double, 9, 1> sigma = w.result.motion.gaussian().covariance.diagonal().cwiseSqrt();
    w.earth_rotation = angle / sigma.segment<3>(3).minCoeff();
    if (first && last) {
      const double speed = 0.5 * (first->state.velocity() + last->state.velocity()).norm();
      w.earth_rotation = std::max(w.earth_rotation, 2 * angle * speed / sigma.tail<3>().minCoeff());
    }
  }
  return w;
}

LIESTAT_FUSION_INLINE RecordingWindows preintegrateWindows(std::span<const ImuSample<double>> readings,
                                                           std::span<const TimeInterval> windows,
                                                           std::span<const GroundTruth> truth,
                                                           const RecordingWindowOptions& options) {
  RecordingWindows result;
  RecordingWindowOptions how = options;
  double& rate = how.integration.preintegration.rate;
  if (!(rate > 0)) rate = readingRate<double>(readings, how.integration.max_gap);
  const ImuNoise<double>& noise = options.integration.preintegration.noise;
  result.with_noise = noise.gyroscope > 0 && noise.accelerometer > 0;
  result.with_truth = !truth.empty();
  result.windows.reserve(windows.size());
  for (const TimeInterval& window : windows) {
    result.windows.push_back(preintegrateWindow(readings, window, truth, how));
  }
  return result;
}

LIESTAT_FUSION_INLINE std::vector<IncrementSigmas> growthOfSigmas(std::span<const ImuSample<double>> readings,
                                                                  const RecordingWindow& window,
                                                                  RecordingOptions<double> options, std::size_t steps) {
  std::vector<IncrementSigmas> growth;
  options.preintegration.bias = window.bias;
  for (std::size_t i = 1; i <= steps; ++i) {
    const double duration = window.result.motion.duration() * static_cast<double>(i) / static_cast<double>(steps);
    const auto part = preintegrate<double>(readings, window.begin, window.begin + duration, options);
    if (part.ok()) growth.push_back(incrementSigmas(part.motion));
  }
  return growth;
}

}  // namespace liestat
