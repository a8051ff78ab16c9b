// Trajectories with covariances, from and to the files of many programs (docs/formats.md):
//
//   const liestat::Trajectory file = liestat::readTrajectory("poses.json");
//   const std::vector<liestat::Gaussian<liestat::SE3d>> poses = liestat::gaussiansOf(file, "ros-fixed");
//   liestat::writeTrajectory("poses.csv", file, {.format = "csv", .convention = liestat::Convention{}});
//
// A matrix is kept in the convention of its file. What the file does not say about it is said by the caller or is an
// error, never guessed.
#pragma once

#include <formats/features.hpp>
#include <formats/text.hpp>
#include <lie/se3.hpp>
#include <stats/conventions.hpp>
#include <stats/gaussian.hpp>
#include <stats/words.hpp>

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// An entry of a covariance that is not known.
inline constexpr double unknown_entry = std::numeric_limits<double>::quiet_NaN();

/// The poses of a file in its order, with the matrices beside them.
struct Trajectory {
  std::string name;           ///< name of the file in messages
  std::string format;         ///< one of trajectoryFormatNames()
  TextList time_texts;        ///< seconds with the digits of the file, exactly; empty if the file has no times
  std::vector<double> times;  ///< the same as numbers, rounded; empty with time_texts
  std::vector<SE3d> poses;
  std::vector<std::int64_t> ids;  ///< numbers of the vertices, ascending, where the poses are those of a graph
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
  std::size_t stamp_decimals = 0;              ///< the file has times in units of so many decimals of a second
  std::vector<std::string> notes;              ///< sentences on what reading has decided

  std::size_t size() const { return poses.size(); }
  bool hasCovariances() const { return !covariances.empty(); }
  bool hasTimes() const { return !times.empty(); }
};

/// The unit of time stamps.
enum class StampUnit { s, ms, us, ns };
constexpr auto words(StampUnit) { return std::array{"s", "ms", "us", "ns"}; }

/// The pose of a stamp that several rows have, with different poses: of the first row, or their mean.
enum class DuplicateRule { drop, mean };
constexpr auto words(DuplicateRule) { return std::array{"drop", "mean"}; }

/// Options of readTrajectory.
struct TrajectoryOptions {
  std::string format = "auto";  ///< one of trajectoryFormatNames(); `auto` looks at the first lines
  std::string covariance_file =
      {};                 ///< a side file of covariances; empty: the file's name with .cov after it, if it exists
  bool side_file = true;  ///< false: no side file is looked for
  /// The layout of the numbers that follow TUM's eight, which no file says.
  std::optional<CovarianceLayout> layout = {};
  double unmeasured = unmeasured_variance;  ///< see unmeasured_variance
  /// The unit of the stamps in formats that leave it open. Nothing: seconds, unless all of them lie beyond the year
  /// 5000 and are stamps since 1970 in ms, us or ns.
  std::optional<StampUnit> time_unit = {};
  ReadingOptions reading = {};  ///< norms, CSV columns, size, frames of a bag; its format is not used
};

/// The names of the formats, `auto` first. Some are only read: matrix, colmap, g2o and toro (their vertices), bag.
std::vector<std::string> trajectoryFormatNames(bool with_read_only = true);

/// Reads poses, and covariances if there are any, from a file, `-` is standard input, or from a topic of a bag
/// (`run.bag:/odom`, docs/bags.md), whose lines are numbers of messages. Throws InputError.
Trajectory readTrajectory(const std::string& path, const TrajectoryOptions& options = {});
/// The text of a file of poses, none of a bag, which is read where it lies.
TextFile loadTrajectoryText(const std::string& path, std::optional<double> largest = {});
/// The same of a file whose text has been loaded, such as a pipe, which can be read only once.
Trajectory readTrajectory(const std::string& path, const TextFile& file, const TrajectoryOptions& options);
/// The same from memory, without side file; `name` stands for the file in messages.
Trajectory parseTrajectory(std::string_view text, std::string name, const TrajectoryOptions& options = {});

/// Puts the rows in the order of their times, each time once, and adds notes on what has changed. A row that repeats
/// stamp, pose (within 1e-9 m and rad) and covariance of an earlier one is dropped; if the poses differ, the rule
/// decides. Throws InputError where they do and there is no rule, and for the mean of poses with covariances, whose
/// convention it would take. Without times there is nothing to do.
void orderInTime(Trajectory& trajectory, std::optional<DuplicateRule> duplicates);

/// Sentences on what reading has changed: rows sorted or dropped, rotations normalised (quaternions that are off by
/// more than six digits' 1e-6, all matrices), components not measured.
std::vector<std::string> notesOf(const Trajectory& trajectory, const TrajectoryOptions& options);

/// Poses and covariances in the library's convention (stats/gaussian.hpp); NaN for what is unknown, throughout if the
/// trajectory has no covariances. `convention` is the name of that in which the file has them, such as ros-fixed
/// (stats/convention_presets.hpp); it may be empty if file or format states it. Throws InputError where nothing says
/// it, where the two contradict each other, and where a matrix is indefinite, which no covariance is.
std::vector<Gaussian<SE3d>> gaussiansOf(const Trajectory& trajectory, std::string_view convention = {});
/// The same of matrices in a convention, whatever the file states. Only for a trajectory that has covariances.
std::vector<Gaussian<SE3d>> gaussiansOf(const Trajectory& trajectory, const Convention& convention);

/// The trajectory of Gaussians, with their times in s if there are any (one for each).
Trajectory trajectoryOf(std::span<const Gaussian<SE3d>> poses, std::span<const double> times = {});

/// The convention in which the covariances of a trajectory are to be read: what the file states and what the user says
/// with an option (its name is for messages). What the user says stands above the rule of a format, but must not
/// contradict a header. Throws InputError where neither says it.
Convention conventionOf(const Trajectory& trajectory, const std::optional<Convention>& given, std::string_view option);

/// The convention named by an option, as stats/convention_presets.hpp spells it; throws OptionError with the names that
/// there are.
Convention conventionNamed(const std::string& text, std::string_view option);

/// Options of writeTrajectory.
struct TrajectoryWritingOptions {
  std::string format = {};  ///< one of trajectoryFormatNames() but `auto`; empty: the trajectory's
  /// The convention of the matrices in the file, to which those of the trajectory are converted to first order.
  /// Nothing: the library's where the file says so, MAVLink's in its messages; other formats need one.
  std::optional<Convention> convention = {};
};

/// Writes a trajectory, numbers with 17 digits; `-` is standard output. Formats without a place for covariances (tum,
/// kitti, euroc) get a side file, the path with .cov after it, whose header states the convention. Returns sentences on
/// what the format has no place for. Throws InputError where the trajectory has covariances and does not state their
/// convention, where the format needs times that are not there, or cannot say that an entry is unknown; OptionError
/// where the format needs a convention.
std::vector<std::string> writeTrajectory(const std::string& path, const Trajectory& trajectory,
                                         const TrajectoryWritingOptions& options = {});

/// A trajectory as text.
struct TrajectoryText {
  std::string text;
  std::string side_file;            ///< covariances, for formats without a place for them; empty if there are none
  std::size_t n_rounded_times = 0;  ///< times with digits below the format's unit, which were cut off
  std::size_t n_lost_cross = 0;     ///< covariances whose cross block the format or layout has no place for
  std::size_t n_marked = 0;         ///< components written with the variance that means "not measured"
};

/// The text of a trajectory in a format. Its covariances are matrices of the convention, as conventionToWrite returns
/// it. Throws InputError as writeTrajectory does.
TrajectoryText formatTrajectory(const Trajectory& trajectory, std::string_view format, const Convention& convention);

/// Sentences on what the format has no place for.
std::vector<std::string> notesOf(const TrajectoryText& text, std::string_view format, const Convention& convention);

/// The convention of a result in a format: the one that is asked for (as conventionNamed reads it; empty: none), or
/// liestat's where the file can say so, with what the format has of its own: order, layout. Throws OptionError, which
/// names the caller and its option.
Convention conventionToWrite(std::string_view format, const std::string& asked, const std::string& caller,
                             std::string_view option);

}  // namespace liestat
