// Refinement of a visual-inertial initialisation: the most probable states at all images, gravity, biases and features,
// given the bearings, the inertial sensor's motions with their covariance, and what is known of the biases beforehand.
//
//   const auto refined = liestat::refine(window, found.result.solutions[0], {.gyroscope = found.bias}, options);
//   if (refined.ok()) … refined.velocity(), refined.gravity, refined.covariance.atLast(), refined.states.back()
//
// Unlike the closed form's, its covariance contains all that is modelled: image noise, the inertial sensor's noise and
// its biases. Derivation: docs/theory/visual_inertial.md, section 3.7; C. Forster et al., "On-manifold
// preintegration", IEEE T-RO 33, 2017; features are eliminated one by one (B. Triggs et al., "Bundle adjustment - a
// modern synthesis", 2000, section 6.1), and what remains is minimised by Levenberg's and Marquardt's method: plain
// Gauss–Newton fails from short windows.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/results.hpp>

namespace liestat {

/// The most probable motion next to a start: a solution of the closed form, and the biases with which it was found (its
/// own correction of the accelerometer's is added). The motions must have been integrated with the sensor's noise;
/// where the biases go too far for their first-order update, the window is integrated anew and refined on from there.
LIESTAT_FUSION_API RefinementResult refine(InertialWindow window, const ClosedFormSolution& start,
                                           const ImuBias<double>& start_bias, const InitialisationOptions& options);

/// On from a former result for the same window, whose prior or noise may have been another.
LIESTAT_FUSION_API RefinementResult refine(InertialWindow window, const RefinementResult& former,
                                           const InitialisationOptions& options);

/// The most probable gravity and biases of a window in which the body stays where it is (it may turn), from a first guess
/// of gravity: `states` have no velocity and position, there are no `features`, and `covariance` says how far the
/// accelerometer's bias and the tilt stand for each other. stationary: the readings scatter as their noise says
/// (p ≥ 1e-3); no_parallax: they do not. Otherwise as refine(). Whether tracks show a motion is not asked: that is
/// solveClosedForm()'s stationary.
LIESTAT_FUSION_API RefinementResult refineAtRest(InertialWindow window, const Eigen::Vector3d& gravity,
                                                 const ImuBias<double>& start_bias,
                                                 const InitialisationOptions& options);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/refine.hpp>
#endif
