// How noisy the inertial sensor is in motion, from a recording: the factor of its densities at which the windows of the
// recording agree with each other.
//
//   const auto found = liestat::calibrateNoise(recording, {.window = 3});
//   if (found.status == liestat::FusionStatus::ok) … found.common.factor, found.common.low, found.common.high
//
// Data sheets tell the noise of a sensor at rest. In motion scale factors, vibration and time stamps add to it, which
// the refinement of a window does not see, because bearings rule its cost; but where two windows meet (window_fusion.hpp)
// their difference d has the covariance S that both say, which grows with the densities. The factors maximise the
// likelihood of all meetings, Σ dᵀ S⁻¹ d + log det S, and intervals are where it is less by half of χ²₁'s 95 %.
#pragma once

#include <fusion/visual_inertial_types.hpp>

#include <cstddef>
#include <functional>
#include <limits>

namespace liestat {

/// A factor of a density with its 95 % interval.
struct NoiseFactor {
  double factor = 1, low = 0, high = std::numeric_limits<double>::infinity();
};

/// What calibrateNoise() returns.
struct NoiseCalibration {
  /// ok; undetermined: too few windows meet, or any factor explains them; bad_input: see fault.
  FusionStatus status = FusionStatus::bad_input;
  Fault fault;
  NoiseFactor common;                    ///< of both densities and both walks
  NoiseFactor gyroscope, accelerometer;  ///< of each with its walk, where `separable`
  /// Whether the recording tells the two apart: each interval is narrower than a factor of six.
  bool separable = false;
  std::size_t windows = 0, meetings = 0;
  double chi2 = 0;                     ///< of the meetings with the densities as they were given
  double calibrated_chi2 = 0;          ///< and with the common factor
  std::size_t degrees_of_freedom = 0;  ///< of either
};

/// Calibrates the densities of a recording's inertial sensor by its windows. Options as for initialiseRecording();
/// `progress(done, all)` counts windows and then trials of factors.
NoiseCalibration calibrateNoise(const VisualInertialRecording& recording, const VisualInertialOptions& options,
                                const std::function<void(std::size_t done, std::size_t all)>& progress = {});

}  // namespace liestat

#ifndef LIESTAT_COMPILED_FUSION
#include <fusion/detail/calibrate_noise.hpp>
#endif
