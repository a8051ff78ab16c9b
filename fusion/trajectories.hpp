// Trajectories with covariances against a reference: association in time, alignment, absolute and relative errors, NEES.
// (Needs Boost.Math.)
//
//   const auto matches = liestat::associateByInterpolation(reference_times, estimate_times);
//   const auto pairs   = liestat::matchedPoses(matches, reference, estimate);       // Gaussian<SE3d> ranges
//   const auto aligned = liestat::alignWeighted(pairs, liestat::AlignmentModel::se3);
//   const auto fit     = liestat::evaluateConsistency(pairs, aligned);               // NEES with its own degrees of freedom
//   const auto ape     = liestat::absoluteErrors(pairs, liestat::alignUmeyama(pairs, …), liestat::PoseRelation::…);
//
// Errors are ξ_i = Log((A T̂_i)⁻¹ T_i), T̂_i the estimate, T_i the reference, A the alignment: translation (m) before rotation
// (rad), in the axes of the estimated body. After an alignment by least squares (Umeyama, as evo does it) NEES does not
// follow χ², so that consistency is judged from the alignment that the covariances weight, and with 6n - 6, 6n - 7 or 6n - 4
// degrees of freedom. Everything is linear in the number of poses. Derivations: docs/theory/trajectories.md.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <lie/se3.hpp>
#include <stats/gaussian.hpp>
#include <stats/whitened_residuals.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat {

// Association ------------------------------------------------------------------------------------------------------------

/// The pose of the reference that belongs to a pose of the estimate: at `fraction` of the way from the reference's pose
/// `reference` to the next one.
struct TimeMatch {
  std::size_t estimate = 0, reference = 0;
  double fraction = 0;
  double gap = 0;  ///< s, between the two stamps of the reference, or to the nearest one
};

/// The curve between two poses of the reference.
enum class PoseInterpolation {
  geodesic,  ///< the screw motion T₀ Exp(s Log(T₀⁻¹ T₁))
  slerp      ///< straight line of the position, SLERP of the rotation
};

/// For each time of the estimate the place between two stamps of the reference, if these are at most `max_gap` (s) apart; a
/// stamp that is hit exactly needs no neighbour. Both lists ascend strictly. An offset is added to the estimate's times.
std::vector<TimeMatch> associateByInterpolation(std::span<const double> reference_times,
                                                std::span<const double> estimate_times,
                                                double max_gap = std::numeric_limits<double>::infinity(),
                                                double offset = 0);

/// evo's association: each stamp of the shorter list (the reference if both are as long) to the nearest of the other, within
/// max_difference (s); the earlier of two as near. Not one-to-one. Both lists ascend.
std::vector<TimeMatch> associateNearest(std::span<const double> reference_times, std::span<const double> estimate_times,
                                        double max_difference = 0.01, double offset = 0);

/// An estimated pose and the pose of the reference at its time. A reference without covariances has zeros.
struct MatchedPose {
  Gaussian<SE3d> reference, estimate;
};

/// The pairs of an association. The covariance of an interpolated reference is (1 - s) Σ₀ + s Σ₁, an upper bound whatever the
/// correlation of the two. Empty `reference` covariances are zeros: see exactPoses.
std::vector<MatchedPose> matchedPoses(std::span<const TimeMatch> matches, std::span<const Gaussian<SE3d>> reference,
                                      std::span<const Gaussian<SE3d>> estimate,
                                      PoseInterpolation interpolation = PoseInterpolation::geodesic);

/// Poses as Gaussians without uncertainty.
std::vector<Gaussian<SE3d>> exactPoses(std::span<const SE3d> poses);

// Alignment --------------------------------------------------------------------------------------------------------------

/// The transformations that an alignment chooses from.
enum class AlignmentModel {
  none,
  origin,  ///< the first poses are made to agree
  posyaw,  ///< translation and rotation about the vertical z axis
  se3,
  sim3,
  scale  ///< of the positions about the origin of the world, alone (evo's -s without -a)
};

/// The enumerator's name, for files.
const char* name(AlignmentModel model);

/// A similarity x ↦ s R x + t of the world: a pose (R̂, p̂) becomes (R R̂, s R p̂ + t). `covariance` is of δ = (δt, δφ, δσ) with
/// t ← t + δt, R ← Exp(δφ) R, s ← s exp(δσ), along the world's axes; rows of fixed parameters are zero.
struct Alignment {
  AlignmentModel model = AlignmentModel::none;
  bool ok = false;        ///< false: degenerate, not converged, or a covariance that is not positive definite
  bool weighted = false;  ///< by the covariances; otherwise least squares of positions, or the first pose
  SE3d transform = {};    ///< R and t
  double scale = 1;
  Eigen::Matrix<double, 7, 7> covariance = Eigen::Matrix<double, 7, 7>::Zero();
  int parameters = 0;     ///< that were estimated: 0, 4, 6 or 7
  std::size_t poses = 0;  ///< the first poses, from which it was estimated
  int iterations = 0;
  double condition =
      1;  ///< of the information matrix, in units of its diagonal; large: a direction is hardly determined
  std::string fault = {};  ///< why it is not ok

  SE3d operator()(const SE3d& pose) const {
    return SE3d(transform.so3() * pose.so3(), scale * (transform.so3() * pose.translation()) + transform.translation());
  }
};

/// Least squares of the positions, estimate to reference, from the first n_to_align poses (0: all) (Umeyama 1991; posyaw: Zhang
/// and Scaramuzza 2018). As evo: for sim3 the scale is biased by the noise of the estimate. `covariance` is that of the
/// positions' covariances carried through the solution (se3 and posyaw), NaN for sim3 and scale.
Alignment alignUmeyama(std::span<const MatchedPose> poses, AlignmentModel model, std::size_t n_to_align = 0);

/// The most likely alignment under the covariances of full poses, from the first n_to_align poses (0: all). Model `origin` is
/// se3 from one pose; `none` is the identity. The scale is unbiased.
Alignment alignWeighted(std::span<const MatchedPose> poses, AlignmentModel model, std::size_t n_to_align = 0);

// Consistency ------------------------------------------------------------------------------------------------------------

/// A pose's error after alignment, in units of the estimate, and what is known about it.
struct PoseError {
  Eigen::Matrix<double, 6, 1> error;  ///< ξ = Log((A T̂)⁻¹ T), its translation divided by the scale
  /// Covariance of the error: of the pose, less what the alignment took from it (poses that were aligned) or with the
  /// alignment's own covariance (others).
  Eigen::Matrix<double, 6, 6> covariance;
  double nees = 0;      ///< ξᵀ covariance⁻¹ ξ; χ²₆, or NaN where the alignment leaves less than full rank
  double leverage = 0;  ///< share of the alignment's parameters that this pose determines; their sum is their number
};

/// NEES of aligned poses. With n_to_align the poses after those are tested, under the covariance of the alignment that they
/// share.
struct Consistency {
  bool ok = false;
  std::string fault;
  std::size_t n = 0;                ///< poses that were tested
  ResidualTest joint;               ///< exact χ² to first order
  ResidualTest position, rotation;  ///< χ² scaled to the exact mean and variance; `statistic` and `dof` are scaled
  WhitenedResidualTests tests;      ///< of the errors with the covariance above
  std::vector<PoseError> errors;    ///< of all poses, in their order
  std::vector<std::size_t> indefinite;  ///< poses whose covariance is not positive definite
};

/// Judges errors after a weighted alignment (or none): one from least squares has errors that follow no χ².
Consistency evaluateConsistency(std::span<const MatchedPose> poses, const Alignment& alignment);

// Errors as evo has them ---------------------------------------------------------------------------------------------------

/// The number that is made of an error transformation E; evo's names.
enum class PoseRelation {
  full,                        ///< ‖E - I‖ of the 4×4 matrix
  trans_part,                  ///< length of the translation, m
  rot_part,                    ///< ‖R - I‖: not an angle
  angle_deg,                   ///< rotation angle, degrees
  angle_rad,                   ///< rotation angle, rad
  point_distance,              ///< m; in relative errors the difference of lengths
  point_distance_error_ratio,  ///< the same in percent of the reference's length; relative errors only
};

/// evo's statistics of a list of numbers; the standard deviation divides by n. NaN for an empty list.
struct ErrorStatistics {
  double rmse = detail::not_a_number, mean = rmse, median = rmse, std = rmse, min = rmse, max = rmse, sse = rmse;
};
ErrorStatistics errorStatistics(std::span<const double> errors);

/// APE: the error of each pose, E = (A T̂)⁻¹ T, after an alignment.
std::vector<double> absoluteErrors(std::span<const MatchedPose> poses, const Alignment& alignment,
                                   PoseRelation relation);

/// The unit in which the distance of the poses of a pair is counted.
enum class DeltaUnit { frames, degrees, radians, meters };

struct RelativeOptions {
  double delta = 1;
  DeltaUnit unit = DeltaUnit::frames;
  double relative_tolerance = 0.1;  ///< of delta, for all pairs
  bool all_pairs = false;
  bool pairs_from_reference = false;
};

/// Indices (i, j) of poses at a distance, by evo's rules. Empty if there are none or delta is not positive.
std::vector<std::pair<std::size_t, std::size_t>> posePairs(std::span<const MatchedPose> poses,
                                                           const Alignment& alignment, const RelativeOptions& options);

/// RPE: the error of each pair's relative motion, E = (T_i⁻¹ T_j)⁻¹ (T̂_i⁻¹ T̂_j) after alignment. Ratios of pairs at which the
/// reference did not move are left out, and so are their pairs from `pairs`.
std::vector<double> relativeErrors(std::span<const MatchedPose> poses, const Alignment& alignment,
                                   std::vector<std::pair<std::size_t, std::size_t>>& pairs, PoseRelation relation);

/// The assumption on the errors of a pair of poses. Files have covariances of single poses only, so it cannot be read off.
enum class PairsModel {
  independent,  ///< of each other: Σ_j + A Σ_i Aᵀ
  chain         ///< dead reckoning, the later error contains the earlier: Σ_j - A Σ_i Aᵀ
};

/// NEES of relative motions η = ξ_j - A ξ_i, A = Ad(T̂_rel⁻¹), under a model of the pairs. Pairs must not share a pose unless
/// they are neighbours in a chain.
struct RelativeConsistency {
  ResidualTest joint;
  std::size_t n = 0;
  std::size_t indefinite = 0;  ///< pairs whose covariance under the model is not positive definite
};
RelativeConsistency relativeConsistency(std::span<const MatchedPose> poses,
                                        std::span<const std::pair<std::size_t, std::size_t>> pairs, PairsModel model,
                                        double scale = 1);

}  // namespace liestat

#ifndef LIESTAT_COMPILED_FUSION
#include <fusion/detail/evaluate_trajectories.hpp>
#endif
