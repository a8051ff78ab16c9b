// evo's result file: the errors of a trajectory as `evo_res` reads them. (Needs Boost.Math for the types of the evaluation.)
//
//   const auto e = liestat::evaluateTrajectory(reference, estimate, options);
//   if (e.ok()) liestat::writeOutput("ape.zip", liestat::evoResult(e, options, liestat::EvoErrors::ape));
#pragma once

#include <fusion/evaluate_types.hpp>

#include <string>

namespace liestat {

/// The errors of a result file: absolute ones, of `evo_ape`, or relative ones, of `evo_rpe`.
enum class EvoErrors { ape, rpe };

/// Names of the trajectories in the file. Equal ones are told apart by "_estimate" after that of the estimate.
struct EvoNames {
  std::string reference = "reference", estimate = "estimate";
};

/// The bytes of the archive: info.json with the title that evo would write for these options, stats.json, arrays of the
/// errors, times and distances, the alignment, and both trajectories as TUM files; of absolute errors NEES and covariances
/// too, which evo ignores. `e` is the result of evaluateTrajectory() with the options `how`, and ok. Throws InputError,
/// about `path`, for more than 4 GiB.
std::string evoResult(const TrajectoryEvaluation& e, const EvaluationOptions& how, EvoErrors errors,
                      const EvoNames& names = {}, const std::string& path = "result.zip");

}  // namespace liestat
