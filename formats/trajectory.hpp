// Trajectories with covariances from the files of many programs, as they are: whatever convention a matrix is in, it is
// kept, and what the file does not say is said by the user or is an error.
#pragma once

#include <formats/features.hpp>
#include <lie/se3.hpp>
#include <stats/conventions.hpp>
#include <stats/gaussian.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// An entry of a covariance that is not known.
inline constexpr double unknown_entry = std::numeric_limits<double>::quiet_NaN();

/// A variance from which on a ROS or MAVLink message means "not measured" (99999 and 1e6 are customary), m² or rad².
inline constexpr double unmeasured_variance = 9e4;

/// The poses of a file in its order, with the matrices beside them.
struct Trajectory {
  std::string name;                     ///< name of the file in messages
  std::string format;                   ///< one of trajectoryFormatNames()
  std::vector<std::string> time_texts;  ///< seconds as the file writes them, exactly; empty if the file has no times
  std::vector<double> times;            ///< the same as numbers, rounded; empty with time_texts
  std::vector<SE3d> poses;
  /// The matrices in the convention of the file, of which only the layout is undone: fromConvention reads them. NaN for
  /// what is unknown, a whole matrix of it where a row has none. Empty if the file has no covariances.
  std::vector<Matrix6d> covariances;
  std::vector<std::size_t> lines;  ///< the line that each row stands in; 0 where it has none
  std::string covariance_source;   ///< the name of the file that the covariances are from; empty if there are none
  /// The convention that file or format states; nothing if it is for the user to say.
  std::optional<Convention> stated_convention;
  bool states_convention = false;  ///< a header of the file says it, which nobody may contradict; not only the format
  std::optional<CovarianceOrder> fixed_order;  ///< the order that the format has whatever the convention
  std::size_t n_normalised = 0;                ///< rows whose rotation was off its norm by more than rounding
  double largest_norm_error = 0;               ///< the largest such error
  std::size_t n_unmeasured = 0;                ///< rows with a component that a sentinel marks as not measured
  std::vector<std::string> frames;             ///< frame and child frame of messages, if they name them

  std::size_t size() const { return poses.size(); }
  bool hasCovariances() const { return !covariances.empty(); }
  bool hasTimes() const { return !times.empty(); }
};

/// Options of readTrajectory.
struct TrajectoryOptions {
  std::string format = "auto";  ///< one of trajectoryFormatNames(); `auto` looks at the first lines
  std::string covariance_file;  ///< a side file of covariances; empty: the file's name with .cov after it, if it exists
  bool side_file = true;        ///< false: no side file is looked for
  /// The layout of the numbers that follow TUM's eight, which no file says.
  std::optional<CovarianceLayout> layout;
  double unmeasured = unmeasured_variance;  ///< see unmeasured_variance
  ReadingOptions reading;                   ///< norms, CSV columns; its format is not used
};

/// The names of the formats, `auto` first.
std::vector<std::string> trajectoryFormatNames();

/// Reads poses, and covariances if there are any, from a file; `-` is standard input. Throws InputError.
Trajectory readTrajectory(const std::string& path, const TrajectoryOptions& options = {});
/// The same from memory, without side file; `name` stands for the file in messages.
Trajectory parseTrajectory(std::string_view text, std::string name, const TrajectoryOptions& options = {});

/// Sentences on what reading has changed: rotations normalised, components not measured.
std::vector<std::string> notesOf(const Trajectory& trajectory, const TrajectoryOptions& options);

/// The convention in which the covariances of a trajectory are to be read: what the file states and what the user says
/// with an option (its name is for messages). What the user says stands above the rule of a format, but must not
/// contradict a header. Throws InputError where neither says it.
Convention conventionOf(const Trajectory& trajectory, const std::optional<Convention>& given, std::string_view option);

/// Poses and covariances in the library's convention; NaN for what is unknown. Only for a trajectory that has
/// covariances.
std::vector<Gaussian<SE3d>> gaussiansOf(const Trajectory& trajectory, const Convention& convention);

/// The convention named by an option, as stats/convention_presets.hpp spells it; throws InputError with the names that
/// there are.
Convention conventionNamed(const std::string& text, std::string_view option);

}  // namespace liestat
