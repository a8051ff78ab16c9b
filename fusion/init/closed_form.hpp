// Visual-inertial initialisation in closed form: velocity, gravity and the positions of features out of a second or
// more of images and inertial readings, without a first guess.
//
//   liestat::ClosedFormWindow window;             // images: C_j, S_j of preintegration; features: their bearings
//   const auto result = liestat::solveClosedForm(window, {.bearing_noise = 1. / 450});
//   if (result.ok()) … result.solutions[0].velocity, .gravity, .features
//
// For a feature P seen along u from image j at dt, in the body's axes at the first image,
//   P - V dt - G dt²/2 - S_j - C_j p_c  is a multiple of u,
// which is linear in P, V and G (A. Martinelli, "Closed-form solution to the structure from motion problem by fusing
// visual and inertial sensing", 2012; the design note on visual-inertial initialisation, section 3). Two equations an
// observation, across the bearing; features are eliminated one by one; gravity's length makes the rest a least-squares
// problem on a sphere, which has up to two minima. Both are returned, with a status that says whether the data decide.
//
// It is in double only: its ranks are decided at 1e-10.
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <fusion/detail/closed_form_input.hpp>
#include <fusion/detail/closed_form_run.hpp>

#include <Eigen/Core>

namespace liestat {

/// The factor γ₂ by which the second solution's scene and motion are the first one's scaled, for an acceleration that
/// is constant or seen by three images only: A the specific force (with three images its mean, meanSpecificForce), G
/// gravity (m/s²). The second solution is (γ₂ P, γ₂ (V + L) - L, γ₂ (A + G) - A), L = S₂/dt₂ - A dt₂/2, which is 0 for
/// a constant acceleration. γ₂ = 1: a double root; γ₂ ≤ 0 (|A| ≤ |G|): the second has its features behind the camera. A
/// camera away from the body's origin (p_c) fixes the scale and voids it where the body rotates. Design note 3.3.
inline double secondSolutionScale(const Eigen::Vector3d& specific_force, const Eigen::Vector3d& gravity) {
  return (specific_force.squaredNorm() - gravity.squaredNorm()) / (specific_force + gravity).squaredNorm();
}

/// The mean specific force in the body's axes at the first image that three images feel: the second divided difference
/// of S at the first, second and third. Any accelerations.
inline Eigen::Vector3d meanSpecificForce(const WindowImage& second, const WindowImage& third) {
  return 2 / (third.time - second.time) * (third.displacement / third.time - second.displacement / second.time);
}

/// Velocity, gravity and features of a window. Input that can't be used gives bad_input with a fault, never a crash.
inline ClosedFormResult solveClosedForm(const ClosedFormWindow& window, const InitialisationOptions& options = {}) {
  ClosedFormResult result;
  result.fault = detail::faultOf(window, options);
  if (result.fault) return result;
  detail::RayTable table = detail::rayTable(window, result);
  if (table.features() == 0) {
    result.fault = FaultKind::no_feature;
    return result;
  }
  detail::ClosedFormRun(table, options, result).run();
  return result;
}

}  // namespace liestat
