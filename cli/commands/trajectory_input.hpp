// Trajectories and their reference as the commands evaluate and doctor take them: files, conventions, times.
#pragma once

#include <cli/commands/reading_options.hpp>
#include <formats/trajectory.hpp>
#include <fusion/evaluate.hpp>

#include <string>

namespace liestat::cli {

/// Options on files of trajectories that both commands have.
struct TrajectoryInputOptions {
  TrajectoryOptions estimate, reference;
  std::optional<DuplicateRule> duplicates;
  AssociationOptions association;

  /// Declares them, evo's names included.
  void declare(const Command& command);
  /// Takes over what is given as text. Throws OptionError.
  void settle();
};

/// A file that is a trajectory in time, at least one pose: see orderInTime. Its notes are all that is to be said about the
/// reading. Throws InputError.
Trajectory readTimedTrajectory(const std::string& path, const TrajectoryOptions& options,
                               std::optional<DuplicateRule> duplicates);
/// The same of a file whose text has been loaded.
Trajectory readTimedTrajectory(const std::string& path, const TextFile& file, const TrajectoryOptions& options,
                               std::optional<DuplicateRule> duplicates);

/// Throws InputError where both are vertices of graphs and not the same ones, since row belongs to row.
void requireSameVertices(const Trajectory& reference, const Trajectory& estimate);

/// The library's words for why two trajectories cannot be compared, with file and remedy. Throws InputError always.
[[noreturn]] void refuse(EvaluationStatus status, const std::string& reason, const Trajectory& reference,
                         const Trajectory& estimate, const TrajectoryInputOptions& options);

}  // namespace liestat::cli
