// The gyroscope's bias out of a window of which up to half of the tracks are wrong, without a first guess and without
// the accelerometer: from the rotations between images alone. Where solveClosedFormRobustly begins when the bias is
// unknown: consensus on the motion fails from 0.05 rad/s on.
//
//   const auto start = liestat::estimateEpipolarGyroscopeBias(window, {.bearing_noise = 1. / 450});
//   if (start.ok()) … start.bias, start.covariance, start.inliers
//
// The directions u and u' of a feature from two images and the translation between these lie in a plane: for the right
// rotation all normals u × u' are orthogonal to one vector, whatever depths and speeds are. The bias is what makes them
// so for pairs of images 1, 2, 4 … steps apart, each with a translation of its own, in least squares of angles.
// Sources: L. Kneip and S. Lynen, "Direct optimization of frame-to-frame rotation", ICCV 2013; Y. He et al., "A
// rotation-translation-decoupled solution for robust and efficient visual-inertial initialization", CVPR 2023; here
// normals are weighted by their noise, translations are unknowns of the least squares (variable projection) instead of
// eigenvectors, whose eigenvalues noise shifts, and tracks have the weights of Geman and McClure until they are
// accepted or rejected.
//
// Without parallax normals are pure noise and do not constrain the rotation. Two rules keep that out: a window whose
// directions all stay where they are, after rotations that the bias explains, is solved for that, without translations
// (without_parallax: at rest, pure rotation); in others a pair of images counts only if its directions have moved,
// beyond what any rotation explains, by `min_parallax` sigmas. What both leave out, hardly
// any parallax, is `undetermined`. Several rotations may then explain the normals: a minimum must have its features in
// front of the camera, and no mean parallax far beyond the differences between parallaxes; `others` are those next to
// it. A lever arm of the camera only changes the translations. Residuals are weighted by the noise of bearings alone:
// the gyroscope's must be smaller over the window (3e-4 rad in two seconds of an ADIS16448, where a pixel is 2e-3).
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/results.hpp>

namespace liestat {

/// The bias that the rotations between images say. The window is integrated anew where first order will not do.
LIESTAT_FUSION_API EpipolarBiasResult estimateEpipolarGyroscopeBias(const InertialWindow& window,
                                                                    const InitialisationOptions& options);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/estimate_epipolar_gyroscope_bias.hpp>
#endif
