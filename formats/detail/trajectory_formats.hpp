// Formats of trajectories: one row each in formats/detail/trajectory_formats.cpp, reader and writer in a source of its own.
#pragma once

#include <formats/bag.hpp>
#include <formats/trajectory.hpp>

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace liestat::detail {

struct TrajectoryFormat;

/// The beginning of a file, by which formats are told apart.
struct TrajectoryBeginning {
  std::string_view line;  ///< the first with content
  std::string_view text;
  std::size_t numbers = 0;        ///< fields of that line, if all are numbers
  std::string_view comment = {};  ///< the comment above it
};

/// A text that is read.
struct TrajectorySource {
  std::string_view text;
  const TrajectoryFormat& format;
  const TrajectoryOptions& options;
};

/// A trajectory that is written: what writers need of it, and the text to which they append. Its matrices are in the
/// convention. Throws InputError for what the format cannot say.
class TrajectorySink {
 public:
  TrajectorySink(const Trajectory& trajectory, const TrajectoryFormat& format, const Convention& convention)
      : trajectory_(trajectory), format_(format), convention_(convention) {}

  std::string& text() { return result_.text; }
  TrajectoryText take() { return std::move(result_); }

  std::size_t size() const { return trajectory_.size(); }
  bool hasCovariances() const { return trajectory_.hasCovariances(); }
  bool hasTimes() const { return trajectory_.hasTimes(); }
  const Convention& convention() const { return convention_; }
  /// Translation (x y z), and quaternion with w last or first, of pose i.
  Eigen::Vector3d position(std::size_t i) const { return trajectory_.poses[i].translation(); }
  Eigen::Vector4d xyzw(std::size_t i) const { return trajectory_.poses[i].unit_quaternion().coeffs(); }
  Eigen::Vector4d wxyz(std::size_t i) const;
  SE3d pose(std::size_t i) const { return trajectory_.poses[i]; }
  /// The time of pose i: seconds as they were read, whole units of the format, or seconds and nanoseconds.
  std::string seconds(std::size_t i) const { return trajectory_.time_texts[i]; }
  std::string ticks(std::size_t i);
  std::pair<std::string, std::string> stamp(std::size_t i);
  /// The numbers of covariance i in the layout. A message has no word for a single unknown entry: a component that is
  /// unknown gets the customary large variance, and of a matrix of which nothing is known all are 0 but the first.
  std::vector<double> covariance(std::size_t i) const;
  std::vector<double> messageCovariance(std::size_t i, double first_of_unknown);
  /// The frame's name, if it is of the characters that ROS allows.
  std::string frame() const;

  /// Appends numbers with 17 digits: one, several with a separator before each, a JSON list with null for NaN.
  void number(double value);
  template <class Values>
  void numbers(const Values& values, char separator) {
    for (const double value : values) text() += separator, number(value);
  }
  void list(const std::vector<double>& values);

  /// The side file of the covariances, with the convention in its header.
  void sideFile();

 private:
  const Trajectory& trajectory_;
  const TrajectoryFormat& format_;
  const Convention& convention_;
  TrajectoryText result_;
};

using TrajectoryReader = void(const TrajectorySource& source, Trajectory& trajectory);
using TrajectoryWriter = void(TrajectorySink& sink);

/// Times beside the poses: never there, there in some files, or always.
enum class TrajectoryTimes { none, optional, required };
/// Where covariances stand, and who says what they mean.
enum class CovariancePlace {
  side_file,  ///< in a file beside the poses, whose header states the convention
  header,     ///< in the rows; a header of the file states the convention if it is not the library's
  rows        ///< in the rows; the preset is meant, or what the user says
};

/// A format of trajectories. What it fixes of a convention is set in what is read and in what is written.
struct TrajectoryFormat {
  std::string_view name;
  bool (*recognises)(const TrajectoryBeginning& beginning);
  TrajectoryReader* read;
  TrajectoryWriter* write;  ///< null: the format is only read
  TrajectoryTimes times = TrajectoryTimes::required;
  std::size_t time_decimals = 0;  ///< times are whole units of 10^-time_decimals s; 0: seconds with a point
  CovariancePlace covariances = CovariancePlace::rows;
  std::optional<CovarianceLayout> layout = {};  ///< that of a covariance in a row
  std::optional<CovarianceOrder> order = {};
  std::string_view preset = {};  ///< convention of the matrices unless the user names another
  bool takes_layout = false;     ///< further columns may have a covariance, whose layout the user names

  /// True if the format says, in the file or beside it, what its covariances mean.
  bool selfDescribing() const { return covariances != CovariancePlace::rows; }
};

/// Reads poses as features (formats/features.hpp), in the format of that name; times and, where a header names columns,
/// covariances.
void readAsFeatures(const TrajectorySource& source, Trajectory& trajectory);

/// Poses of a bag: a topic of poses, or the chain of transforms that the options name. Throws InputError.
Trajectory readBagTrajectory(const std::string& path, const TrajectoryOptions& options);
/// Throws InputError: a topic is none of the bag's.
[[noreturn]] void requireBagTopic(const std::string& name, const std::string& topic,
                                  const std::vector<BagTopic>& topics);

/// True if a line is one of COLMAP's images.txt: a number, a unit quaternion, a translation, a camera, a name.
bool looksLikeColmap(std::string_view line);
/// True if a text begins with a matrix of four lines of four numbers, or with one below a line of three whole numbers.
bool looksLikeBlocks(std::string_view text);

/// All formats, in the order in which they are tried.
std::span<const TrajectoryFormat> trajectoryFormats();
/// The format of that name; throws InputError with the names that there are.
const TrajectoryFormat& trajectoryFormat(std::string_view name);

}  // namespace liestat::detail
