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
// and, where windows are disjoint, fused with its neighbours (window_fusion.hpp). Where these meet, they test the noise
// densities, which are calibrated where they are refuted (noise_calibration.hpp). Nothing throws: what is wrong with
// the input is a fault of the result or of a window. Derivation: docs/theory/visual_inertial.md.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/visual_inertial_types.hpp>

#include <cstddef>
#include <functional>

namespace liestat {

/// Slides windows over a recording. progress(done, all), where given, counts windows.
LIESTAT_FUSION_API VisualInertialResult
initialiseRecording(const VisualInertialRecording& recording, const VisualInertialOptions& options,
                    const std::function<void(std::size_t done, std::size_t all)>& progress = {});

/// The start of a filter (fusion/init/filter_start.hpp) from a recording: the state at the end of the last stretch that
/// is ok, or from rest, at the end of the last window that is stationary, whichever is later. untested: without them,
/// that of the last window that is ok. inconsistent: all stretches that were tested are.
LIESTAT_FUSION_API FilterStart filterStart(const VisualInertialResult& result, const FilterStartOptions& options = {});

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/initialise_recording.hpp>
#endif
