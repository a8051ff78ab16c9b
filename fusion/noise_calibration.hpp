// How noisy the inertial sensor is in motion, from a recording: the factors of its densities at which the windows of the
// recording agree with each other.
//
//   const auto found = liestat::calibrateNoise(recording, {.window = 3});
//   recording.noise = found.noise;  // as it was unless the recording refutes it: found.evidence
//
// initialiseRecording() does this by itself, unless VisualInertialOptions::calibrate_noise is false.
//
// Data sheets tell the noise of a sensor at rest. In motion scale factors, vibration and time stamps add to it, which
// the refinement of a window does not see, because bearings rule its cost; but where two windows meet (window_fusion.hpp)
// their difference d has the covariance S that both expect, which grows with the densities. The factors minimise
// Σ dᵀ S⁻¹ d + log det S over all meetings, minus twice the log-likelihood; intervals are those of its profiles, for few
// meetings widened by Student's law.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/noise_calibration_types.hpp>
#include <fusion/visual_inertial_types.hpp>

#include <cstddef>
#include <functional>

namespace liestat {

/// Calibrates the densities of a recording's inertial sensor by its windows. Options as for initialiseRecording();
/// `progress(done, all)` counts windows, and then passes over all of them.
LIESTAT_FUSION_API NoiseCalibration
calibrateNoise(const VisualInertialRecording& recording, const VisualInertialOptions& options,
               const std::function<void(std::size_t done, std::size_t all)>& progress = {});

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/calibrate_noise.hpp>
#endif
