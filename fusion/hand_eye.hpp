// Hand-eye and robot-world calibration: extrinsic poses from pairs of poses that both carry noise, with their
// covariance and with the directions that the motions leave open.
//
//   A_i = base_T_gripper,  B_i = target_T_camera,  X = gripper_T_camera,  Y = base_T_target
//
//   absolute poses   A_i X = Y B_i    estimateRobotWorld(poses)   one error per pose; Y is a nuisance, or wanted too
//   motions          A_i X = X B_i    estimateHandEye(motions)    independent relative motions, of two odometries
//
// Relative motions computed from absolute poses have correlated errors: the covariance would be too small by a factor
// of several, and χ² does not show it. Use estimateRobotWorld for absolute poses.
//
//   std::vector<liestat::PosePair> poses;  // {{base_T_gripper, Σ_a}, {target_T_camera, Σ_b}}
//   const auto result = liestat::estimateRobotWorld(poses);
//   if (result.ok()) use(result.X.mean, result.X.covariance);
//   else for (const auto& d : result.directions) std::puts(describe(d, "gripper").c_str());
//
// The estimate is that of stats/constrained.hpp: the most likely X, Y and corrected poses under the equations
// Log(X⁻¹ A⁻¹ Y B) = 0. Covariances are those of local errors, T·Exp(e), translation (m) before rotation (rad). The
// iteration starts from closed forms, several if the motion is degenerate, and outliers are found. The result has the
// same bits for any order of the pairs. docs/hand_eye.md has figures, limits and the conventions of other libraries.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/hand_eye_types.hpp>

#include <span>

namespace liestat {

/// AX = YB from at least three pairs of absolute poses with independent errors (degrees of freedom 6 n - 12, one more
/// for each open direction).
LIESTAT_FUSION_API HandEyeResult estimateRobotWorld(std::span<const PosePair> poses,
                                                    const HandEyeOptions& options = {});
/// The same in less memory: the list is given up.
LIESTAT_FUSION_API HandEyeResult estimateRobotWorld(PosePairList poses, HandEyeOptions options);

/// AX = XB from at least two pairs of relative motions with independent errors (degrees of freedom 6 n - 6, one more
/// for each open direction).
LIESTAT_FUSION_API HandEyeResult estimateHandEye(std::span<const PosePair> motions, const HandEyeOptions& options = {});
/// The same in less memory: the list is given up.
LIESTAT_FUSION_API HandEyeResult estimateHandEye(PosePairList motions, HandEyeOptions options);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/hand_eye/detail/estimate_hand_eye.hpp>
#endif
