// A trajectory against a reference: association in time, alignments, absolute and relative errors as evo defines them,
// and a verdict on the covariances, which evo ignores. (Needs Boost.Math.)
//
//   const liestat::TrajectoryEvaluation e = liestat::evaluateTrajectory(reference, estimate, options);
//   if (!e.ok()) …                      // e.reason: the times do not overlap, …
//   e.ape_statistics.rmse               // m
//   if (e.verdict().isNo()) …           // e.verdict().text, .causes
//
// The program (`liestat evaluate`) and Python (`liestat.evaluate_trajectory`) print this result. The steps by
// themselves are in fusion/trajectories.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/evaluate_types.hpp>
#include <fusion/trajectories.hpp>

namespace liestat {

/// A trajectory as its association sees it.
struct PoseStamps {
  std::span<const double> times;  ///< s, strictly ascending; empty: row belongs to row
  std::size_t poses = 0;
  std::string_view name = {};  ///< for sentences
};

/// The partners of the estimate's poses, by time, or by row where neither has times. Poses before the options' `start`
/// and after their `end` must have been left out: see rowsBetween. Never throws: see the status.
LIESTAT_TRAJECTORIES_API Associated associate(const PoseStamps& reference, const PoseStamps& estimate,
                                              const AssociationOptions& options = {});

/// The times from `start` to `end`, both included, as indices; where one is not given, there is no bound.
LIESTAT_TRAJECTORIES_API std::vector<std::size_t> rowsBetween(std::span<const double> times,
                                                              std::optional<double> start, std::optional<double> end);

/// A sentence if the quaternions of one of two trajectories look as if w came first: relative rotations over a fifth of
/// the run then agree five times better. Empty otherwise, and for fewer than ten poses.
LIESTAT_TRAJECTORIES_API std::string suspectQuaternionOrder(MatchedRange poses, std::string_view reference,
                                                            std::string_view estimate);

/// Compares an estimate with a reference. The verdict is that of errors after an alignment which the covariances
/// weight; those of APE and RPE follow no χ². Never throws: where the data or the options do not allow a comparison,
/// `status` and `reason` say why, and errors are empty, statistics NaN. O(n).
LIESTAT_TRAJECTORIES_API TrajectoryEvaluation evaluateTrajectory(const PoseTrajectory& reference,
                                                                 PoseTrajectory estimate,
                                                                 const EvaluationOptions& options = {});

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/trajectories/detail/evaluate_trajectory.hpp>
#endif
