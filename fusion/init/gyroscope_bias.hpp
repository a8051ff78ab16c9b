// The gyroscope's bias out of a window: the closed form is not robust to it (0.05 rad/s cost a sixth of the scale and
// two degrees of gravity over two seconds), and has no linear unknown for it.
//
//   const auto found = liestat::estimateGyroscopeBias(window, {.bearing_noise = 1. / 450});
//   if (found.ok()) … found.bias, found.covariance, found.result.solutions[0]
//
// The outer problem over the bias (docs/theory/visual_inertial.md, section 3.6): the bearings' angles as a function of
// the bias, with velocity, gravity and features the best for each, by damped Gauss–Newton with these eliminated. Angles
// of predicted directions are minimised, not the linear system's residuals: those shrink with the scene, and a large
// bias that lets depths collapse makes them small. Each round begins at the closed form for the bias that the last one
// found.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/closed_form_types.hpp>

#include <Eigen/Core>

namespace liestat {

/// The result of estimateGyroscopeBias().
struct GyroscopeBiasResult {
  /// ok, not_converged, no_start (then see result.status), window_too_short or bad_input (then see result.fault).
  FusionStatus status = FusionStatus::bad_input;
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();  ///< rad/s, whole: not the change of the one that was integrated
  /// From image noise and the prior; without the inertial sensor's noise.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  ClosedFormResult result;  ///< for this bias
  double cost = 0;          ///< Σ (angle/noise)² and the priors
  int rounds = 0, iterations = 0;
  int integrations = 0;  ///< how often the readings were integrated anew

  /// Exactly one answer, converged, that explains the data.
  bool ok() const { return status == FusionStatus::ok && result.ok(); }
};

/// The bias that explains the bearings best, with the closed form for it. The window is integrated anew where a
/// first-order update will not do.
LIESTAT_FUSION_API GyroscopeBiasResult estimateGyroscopeBias(InertialWindow window,
                                                             const InitialisationOptions& options);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/estimate_gyroscope_bias.hpp>
#endif
