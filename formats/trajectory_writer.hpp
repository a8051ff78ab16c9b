// Trajectories with covariances to the files of other programs, each number with 17 digits.
#pragma once

#include <formats/trajectory.hpp>

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

/// A trajectory as text.
struct TrajectoryText {
  std::string text;
  /// The side file of covariances, for formats that have no place for them (TUM, KITTI, EuRoC); empty if there are none.
  std::string side_file;
  std::size_t n_rounded_times = 0;  ///< times with digits below the format's unit, which were cut off
  std::size_t n_lost_cross = 0;     ///< covariances whose cross block the format or layout has no place for
  std::size_t n_marked = 0;         ///< components written with the variance that means "not measured"
};

/// Sentences on what the format has no place for.
std::vector<std::string> notesOf(const TrajectoryText& text, std::string_view format, const Convention& convention);

/// True if the format says, in the file or beside it, what its covariances mean; others need the user to know.
bool isSelfDescribing(std::string_view format);
/// The convention with what the format has of its own: order, layout.
Convention conventionFor(std::string_view format, Convention convention);

/// The convention of a result in a format: the one that is asked for (as conventionNamed reads it; empty: none), or
/// liestat's where the file can say so. Throws InputError, which names the caller and its option.
Convention conventionToWrite(std::string_view format, const std::string& asked, const std::string& caller,
                             std::string_view option);

/// The text of a trajectory in a format (trajectoryFormatNames() without `auto`). Its covariances are matrices of the
/// convention, as conventionFor returns it. Throws InputError if the format needs times that are not there, or cannot
/// say that an entry is unknown.
TrajectoryText formatTrajectory(const Trajectory& trajectory, std::string_view format, const Convention& convention);

}  // namespace liestat
