// Windows of a recording of an inertial sensor: the motion over each, its errors against a truth, and the verdict on
// the covariances.
//
//   liestat::RecordingWindowOptions options;
//   options.integration.preintegration.noise = noise;
//   const auto result = liestat::preintegrateWindows(
//       readings, liestat::consecutiveWindows(0, 60, 1), truth, options);  // one second each
//   std::puts(result.verdict().text.c_str());
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/ground_truth.hpp>
#include <fusion/imu/recording_windows_types.hpp>

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace liestat {

/// Times, s.
struct TimeInterval {
  double begin = 0, end = 0;
};

/// Whole intervals of `length` s, one after the other from `begin` (without a length one, to `end`). The last one is
/// kept where rounding alone would take it away. Empty where none fits, more than `max_count` do, or a number is not
/// finite.
LIESTAT_TRAJECTORIES_API std::vector<TimeInterval> consecutiveWindows(double begin, double end,
                                                                      std::optional<double> length = {},
                                                                      double max_count = 1e6);

struct RecordingWindowOptions {
  RecordingOptions<double> integration = {};  ///< its bias is replaced, see `bias`
  /// The sensor's bias; none: that of the truth at the beginning of each window, zero where there is no truth.
  std::optional<ImuBias<double>> bias = {};
  double gravity = 9.81;  ///< m/s², downwards along z in the truth's world
  /// rad/s, of the truth's world in its own axes: see statesInFixedAxes(). Zero: the Earth's is neglected.
  Eigen::Vector3d world_rate = Eigen::Vector3d::Zero();
};

/// The motion over one window of readings (in the order of time, as for preintegrate()); `truth` may be empty. Nothing
/// throws: see RecordingResult::fault.
LIESTAT_TRAJECTORIES_API RecordingWindow preintegrateWindow(std::span<const ImuSample<double>> readings,
                                                            const TimeInterval& window,
                                                            std::span<const GroundTruth> truth = {},
                                                            const RecordingWindowOptions& options = {});
/// Those over several, in their order.
LIESTAT_TRAJECTORIES_API RecordingWindows preintegrateWindows(std::span<const ImuSample<double>> readings,
                                                              std::span<const TimeInterval> windows,
                                                              std::span<const GroundTruth> truth = {},
                                                              const RecordingWindowOptions& options = {});

/// The standard deviations of increments from the beginning of the window on, in `steps` equal steps of its duration.
LIESTAT_TRAJECTORIES_API std::vector<IncrementSigmas> growthOfSigmas(std::span<const ImuSample<double>> readings,
                                                                     const RecordingWindow& window,
                                                                     RecordingOptions<double> options,
                                                                     std::size_t steps = 50);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/imu/detail/preintegrate_windows.hpp>
#endif
