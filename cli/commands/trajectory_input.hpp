// Trajectories and their reference as the commands evaluate and doctor take them: files, conventions, times.
#pragma once

#include <cli/commands/command_line.hpp>
#include <cli/io/trajectory_file.hpp>
#include <fusion/trajectories.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// Options on files of trajectories that both commands have.
struct TrajectoryInputOptions {
  TrajectoryOptions estimate, reference;
  std::string layout;  ///< of the numbers after TUM's eight; empty: unsaid
  std::string association = "interpolate";
  std::string interpolation = "geodesic";
  std::optional<double> max_gap;     ///< s; five times the median distance of the reference's stamps if unset
  double max_difference = 0.01;      ///< s, of nearest stamps
  double offset = 0;                 ///< s, added to the estimate's times
  std::optional<double> start, end;  ///< s, of the reference

  /// Declares them, evo's names included.
  void declare(const Command& command);
  /// Takes over what is given as text. Throws InputError.
  void settle();
};

/// A file that is a trajectory in time: times ascend strictly, at least one pose. Throws InputError.
Trajectory readTimedTrajectory(const std::string& path, const TrajectoryOptions& options);

/// The association of two trajectories: by time, or by row where neither has times.
struct Associated {
  std::vector<TimeMatch> matches;
  bool by_time = true;
  double max_gap = 0;  ///< s, as it was applied
};
/// Throws InputError where times do not overlap or nothing matches.
Associated associate(const Trajectory& reference, const Trajectory& estimate, const TrajectoryInputOptions& options);

/// The reference between two times; the estimate keeps all of its poses.
void cutTimes(Trajectory& reference, const TrajectoryInputOptions& options);

/// The rows of a trajectory in a list.
Trajectory rowsOf(const Trajectory& trajectory, const std::vector<std::size_t>& rows);

/// A sentence if the quaternions of one of the files look as if w came first: relative rotations then agree far better. Empty
/// otherwise.
std::string suspectQuaternionOrder(const std::vector<MatchedPose>& poses, const std::string& reference,
                                   const std::string& estimate);

}  // namespace liestat::cli
