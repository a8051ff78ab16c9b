// Trajectories and their reference as the commands evaluate and doctor take them: files, conventions, times.
#pragma once

#include <cli/commands/command_line.hpp>
#include <formats/trajectory.hpp>
#include <fusion/evaluate.hpp>

#include <string>

namespace liestat::cli {

/// Options on files of trajectories that both commands have.
struct TrajectoryInputOptions {
  TrajectoryOptions estimate, reference;
  std::string layout;  ///< layout of the numbers after TUM's eight; empty: not given
  AssociationOptions association;

  /// Declares them, evo's names included.
  void declare(const Command& command);
  /// Takes over what is given as text. Throws OptionError.
  void settle();
};

/// A file that is a trajectory in time: times ascend strictly, at least one pose. Throws InputError.
Trajectory readTimedTrajectory(const std::string& path, const TrajectoryOptions& options);

/// The library's words for why two trajectories cannot be compared, with file and remedy. Throws InputError always.
[[noreturn]] void refuse(EvaluationStatus status, const std::string& reason, const Trajectory& reference,
                         const Trajectory& estimate, const TrajectoryInputOptions& options);

}  // namespace liestat::cli
