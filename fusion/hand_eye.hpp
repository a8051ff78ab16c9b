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
#include <fusion/status.hpp>
#include <lie/se3.hpp>
#include <stats/gaussian.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat {

/// Poses (or motions) of both sensors at one time. Covariances may be singular, and one of them zero (an exact pose),
/// if both together have rank six.
struct PosePair {
  Gaussian<SE3d> a, b;
};

struct HandEyeOptions {
  /// `false`: the covariances are known up to one common factor, which is estimated from the residuals.
  bool known_noise = true;
  /// Searches for outliers if a pair is beyond the gate in the estimate from all pairs.
  bool find_outliers = true;
  /// Squared error of a pair, in units of its noise, beyond which it is an outlier; χ²₆ at 0.999 by default.
  double gate = 22.457744484825327;
  /// Number of minimal samples in the search for outliers: with 45 % outliers, 80 miss an all-inlier sample once in a
  /// million times.
  int samples = 80;
  /// The excitation from which on a direction is estimated, and that below which noise alone explains it.
  double trusted_excitation = 10, least_excitation = 3;
  /// The fit is `inconsistent` if the probability of exceeding its χ² is smaller.
  double least_p = 1e-3;
  std::uint64_t seed = 1;  ///< seed of the fixed starts and samples
};

/// A direction of X (and Y) that the motions do not determine: the excitation is below the trusted one.
struct OpenDirection {
  /// Ratio of the information to that which the noise of the poses alone would produce; 1 is noise.
  double excitation = 0;
  /// Above the least excitation: fixed like the others, but the motions contain some information on it.
  bool weak = false;
  /// The twist (translation, rotation) in the gripper's frame along which X is open: Exp(s·twist) X. Its rotation has
  /// unit length if there is one, otherwise its translation.
  Eigen::Matrix<double, 6, 1> twist = Eigen::Matrix<double, 6, 1>::Zero();
  /// The same for Y, in the base's frame; zero for motions.
  Eigen::Matrix<double, 6, 1> twist_of_Y = Eigen::Matrix<double, 6, 1>::Zero();
  /// The direction rotates X; otherwise it is a pure translation.
  bool rotates = false;
  /// Its axis is the rotation axis of the gripper.
  bool along_rotation_axis = false;
  /// Its axis is the direction of the gripper's translation, without rotation.
  bool along_translation = false;
};

/// "translation along the rotation axis (0.1, 0.0, 1.0) of the gripper".
std::string describe(const OpenDirection& direction, const std::string& frame = "gripper");

/// The fit of one pair.
struct PairFit {
  /// e = Log(X⁻¹ A⁻¹ Y B): translation (m) and rotation (rad) in the camera's frame.
  Eigen::Matrix<double, 6, 1> error = Eigen::Matrix<double, 6, 1>::Constant(std::numeric_limits<double>::quiet_NaN());
  double chi2 = std::numeric_limits<double>::quiet_NaN();  ///< squared length in units of its noise; χ²₆ at the truth
  bool inlier = false;
};

/// A calibration. Statuses:
///   ok             X, and Y, with their covariance
///   undetermined   the motions leave `directions` open; X and Y are one of the solutions that fit
///   ambiguous      a second solution, `rival`, explains the pairs as well
///   inconsistent   the residuals are larger than the covariances predict, or fewer than half of the pairs agree
///   not_converged
///   bad_input      see `fault`
struct HandEyeResult {
  FusionStatus status = FusionStatus::bad_input;
  Fault fault;
  bool world = false;  ///< AX = YB
  /// Y is X for AX = XB. Their covariances are blocks of the joint one.
  Gaussian<SE3d> X = {SE3d(), Eigen::Matrix<double, 6, 6>::Constant(std::numeric_limits<double>::quiet_NaN())}, Y = X;
  /// Joint covariance of the local errors of X and Y, X first (for AX = XB only the block of X is used). Open
  /// directions are treated as known: it is singular if there are `directions`, and NaN if one of them rotates X,
  /// because an arbitrary rotation is not a small error.
  Eigen::Matrix<double, 12, 12> covariance =
      Eigen::Matrix<double, 12, 12>::Constant(std::numeric_limits<double>::quiet_NaN());
  /// Squared distance of the inliers from their corrected poses, under the given covariances. It follows χ².
  double chi2 = std::numeric_limits<double>::quiet_NaN();
  int degrees_of_freedom = 0;
  double p = std::numeric_limits<double>::quiet_NaN();  ///< probability of a larger χ²; NaN if the noise is not known
  /// The factor by which the given covariances of the poses were multiplied: 1 if the noise is known, else χ²/dof.
  double variance_factor = 1;
  /// Excitations of the six directions, ascending.
  Eigen::Matrix<double, 6, 1> excitations = Eigen::Matrix<double, 6, 1>::Zero();
  std::vector<OpenDirection> directions;  ///< those below the trusted excitation, ascending
  std::vector<PairFit> pairs;             ///< in the order of the input
  std::vector<std::size_t> outliers;      ///< indices of the outliers, ascending
  std::optional<SE3d> rival;              ///< X of a second solution that fits as well
  int starts = 0;                         ///< number of starts that were compared

  bool ok() const { return status == FusionStatus::ok; }
  /// True if an open direction rotates X, so that there is no covariance.
  bool rotationIsOpen() const {
    for (const OpenDirection& d : directions) {
      if (d.rotates) return true;
    }
    return false;
  }
};

/// AX = YB from at least three pairs of absolute poses with independent errors (degrees of freedom 6 n - 12, one more
/// for each open direction).
HandEyeResult estimateRobotWorld(std::span<const PosePair> poses, const HandEyeOptions& options = {});

/// AX = XB from at least two pairs of relative motions with independent errors (degrees of freedom 6 n - 6, one more
/// for each open direction).
HandEyeResult estimateHandEye(std::span<const PosePair> motions, const HandEyeOptions& options = {});

}  // namespace liestat

#ifndef LIESTAT_COMPILED_FUSION
#include <fusion/detail/estimate_hand_eye.hpp>
#endif
