// The whole initialisation of a window of which nothing is known: many tracks may be wrong, and the gyroscope's bias is
// anything up to 0.2 rad/s.
//
//   const auto found = liestat::initialiseRobustly(window, {.bearing_noise = 1. / 450});
//   if (found.ok()) … found.gyroscope_bias, found.result.solutions[0], found.inliers; then refine()
//
// First the gyroscope's bias from rotations alone (epipolar_gyroscope_bias.hpp), which needs no motion and bears wrong
// tracks; for it, and for others that came near where few agree, the consensus on the motion (consensus.hpp);
// on the tracks that agree the bias and the motion together (gyroscope_bias.hpp), and again while tracks come or go. In
// the end a second motion is looked for among the tracks that do not agree: a body that moves among the features, or the
// world behind it.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/results.hpp>

namespace liestat {

/// Velocity, gravity, features and the gyroscope's bias of a window. Bad input: see result.fault.
LIESTAT_FUSION_API RobustInitialisation initialiseRobustly(const InertialWindow& window,
                                                           const InitialisationOptions& options);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/initialise_robustly.hpp>
#endif
