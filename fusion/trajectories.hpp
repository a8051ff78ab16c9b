// Trajectories with covariances against a reference: association in time, alignment, absolute and relative errors,
// NEES. (Needs Boost.Math.)
//
//   const auto matches = liestat::associateByInterpolation(reference_times, estimate_times);
//   const auto pairs   = liestat::matchedPoses(matches, reference, estimate);       // Gaussian<SE3d> ranges
//   const auto aligned = liestat::alignWeighted(pairs, liestat::AlignmentModel::se3);
//   const auto fit     = liestat::evaluateConsistency(pairs, aligned);               // NEES with its own degrees of freedom
//   const auto ape     = liestat::absoluteErrors(pairs, liestat::alignUmeyama(pairs, …), liestat::PoseRelation::…);
//
// evaluateTrajectory (fusion/evaluate.hpp) takes these steps and judges the result.
//
// Errors are ξ_i = Log((A T̂_i)⁻¹ T_i), T̂_i the estimate, T_i the reference, A the alignment: translation (m) before
// rotation (rad), in the axes of the estimated body. After an alignment by least squares (Umeyama, as evo does it) NEES
// does not follow χ², so that consistency is judged from the alignment that the covariances weight, and with 6n - 6, 6n
// - 7 or 6n - 4 degrees of freedom. Everything is linear in the number of poses. Derivations:
// docs/theory/trajectories.md.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/trajectories_types.hpp>

#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

// Association
// ------------------------------------------------------------------------------------------------------------

/// For each time of the estimate the place between two stamps of the reference, if these are at most `max_gap` (s)
/// apart; a stamp that is hit exactly needs no neighbour. Both lists ascend strictly. An offset is added to the
/// estimate's times.
LIESTAT_TRAJECTORIES_API std::vector<TimeMatch> associateByInterpolation(
    std::span<const double> reference_times, std::span<const double> estimate_times,
    double max_gap = std::numeric_limits<double>::infinity(), double offset = 0);

/// evo's association: each stamp of the shorter list (the reference if both are as long) to the nearest of the other,
/// within max_difference (s); the earlier of two as near. Not one-to-one. Both lists ascend.
LIESTAT_TRAJECTORIES_API std::vector<TimeMatch> associateNearest(std::span<const double> reference_times,
                                                                 std::span<const double> estimate_times,
                                                                 double max_difference = 0.01, double offset = 0);

/// The pairs of an association. The covariance of an interpolated reference is (1 - s) Σ₀ + s Σ₁, for the geodesic an
/// upper bound whatever the correlation of the two. Empty `reference` covariances are zeros: see exactPoses. The
/// reference's times (s, one for each pose) serve the cubic; without them its steps are taken as equal.
LIESTAT_TRAJECTORIES_API MatchedPoses matchedPoses(std::span<const TimeMatch> matches, const NoisyPoses& reference,
                                                   const NoisyPoses& estimate,
                                                   PoseInterpolation interpolation = PoseInterpolation::cubic,
                                                   std::span<const double> reference_times = {});

/// Adds `factor` times the second moment of the interpolation's error to the references of matched poses, gap by gap.
/// It is measured from the reference itself: with every second stamp left out (docs/theory/trajectories.md, 1.2). Poses
/// at a stamp have none.
LIESTAT_TRAJECTORIES_API InterpolationError addInterpolationError(std::span<const TimeMatch> matches,
                                                                  const NoisyPoses& reference,
                                                                  std::span<const double> reference_times,
                                                                  PoseInterpolation interpolation, MatchedPoses& poses,
                                                                  double factor = 1);

/// Poses as Gaussians without uncertainty.
LIESTAT_TRAJECTORIES_API NoisyPoses exactPoses(std::vector<SE3d> poses);

// Alignment
// --------------------------------------------------------------------------------------------------------------

/// Least squares of the positions, estimate to reference, from the first n_to_align poses (0: all) (Umeyama 1991;
/// posyaw: Zhang and Scaramuzza 2018). As evo: for sim3 the scale is biased by the noise of the estimate. `covariance`
/// is that of the positions' covariances carried through the solution (se3 and posyaw), NaN for sim3 and scale.
LIESTAT_TRAJECTORIES_API Alignment alignUmeyama(MatchedRange poses, AlignmentModel model, std::size_t n_to_align = 0);

/// The most likely alignment under the covariances of full poses, from the first n_to_align poses (0: all). Model
/// `origin` is se3 from one pose; `none` is the identity. The scale is unbiased. Components of the errors that carry no
/// noise (stats/noise_components.hpp) have no weight; what the others leave open, such as the height of a planar
/// robot's world, stays as the first pose has it. A constant variance among varying ones is judged where errors exceed
/// it.
LIESTAT_TRAJECTORIES_API Alignment alignWeighted(MatchedRange poses, AlignmentModel model, std::size_t n_to_align = 0);

// Consistency
// ------------------------------------------------------------------------------------------------------------

/// Judges the alignment's components of the errors after a weighted alignment (or none): one from least squares has
/// errors that follow no χ².
LIESTAT_TRAJECTORIES_API Consistency evaluateConsistency(MatchedRange poses, const Alignment& alignment);

// Errors as evo has them
// ---------------------------------------------------------------------------------------------------

/// Statistics of a list of numbers.
LIESTAT_TRAJECTORIES_API ErrorStatistics errorStatistics(std::span<const double> errors);

/// APE: the error of each pose, E = (A T̂)⁻¹ T, after an alignment.
LIESTAT_TRAJECTORIES_API std::vector<double> absoluteErrors(MatchedRange poses, const Alignment& alignment,
                                                            PoseRelation relation);

/// Indices (i, j) of poses at a distance, by evo's rules. Empty if there are none or delta is not positive.
LIESTAT_TRAJECTORIES_API std::vector<std::pair<std::size_t, std::size_t>> posePairs(MatchedRange poses,
                                                                                    const Alignment& alignment,
                                                                                    const RelativeOptions& options);

/// RPE: the error of each pair's relative motion, E = (T_i⁻¹ T_j)⁻¹ (T̂_i⁻¹ T̂_j) after alignment. Ratios of pairs at
/// which the reference did not move are left out, and so are their pairs from `pairs`.
LIESTAT_TRAJECTORIES_API std::vector<double> relativeErrors(MatchedRange poses, const Alignment& alignment,
                                                            std::vector<std::pair<std::size_t, std::size_t>>& pairs,
                                                            PoseRelation relation);

/// NEES of the relative motions of pairs under a model; `scale` is that of the alignment. Components that are left out
/// count as exact.
LIESTAT_TRAJECTORIES_API RelativeConsistency
relativeConsistency(MatchedRange poses, std::span<const std::pair<std::size_t, std::size_t>> pairs, PairsModel model,
                    double scale = 1, const NoiseComponents& components = {});

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/trajectories/detail/evaluate_trajectories.hpp>
#endif
