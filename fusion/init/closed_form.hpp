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
// visual and inertial sensing", 2012; docs/theory/visual_inertial.md, section 3). Two equations an
// observation, across the bearing; features are eliminated one by one; gravity's length makes the rest a least-squares
// problem on a sphere, which has up to two minima. Both are returned, with a status that says whether the data decide.
//
// It is in double only: its ranks are decided at 1e-10.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/init/closed_form_types.hpp>

namespace liestat {

/// Velocity, gravity and features of a window. Input that can't be used gives bad_input with a fault, never a crash.
LIESTAT_FUSION_API ClosedFormResult solveClosedForm(const ClosedFormWindow& window,
                                                    const InitialisationOptions& options = {});

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/solve_closed_form.hpp>
#endif
