// Messages of ROS and MAVLink as CSV files whose header names their fields.
#include <formats/detail/trajectory_formats.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

namespace liestat::detail {
namespace {

/// A CSV file by the names of its columns.
class NamedColumns {
 public:
  NamedColumns(std::string_view text, const std::string& file) : reader_(text), file_(file) {
    if (!reader_.next()) throw InputError(file_, 0, "the file has no data, only blank lines and comments");
    splitFields(reader_.line(), Separator::comma, fields_);
    names_.assign(fields_.begin(), fields_.end());
  }
  /// The place of the first of the names that there is; throws InputError if it is required and there is none.
  std::size_t find(const std::vector<std::string>& names, bool required = false) const {
    for (const std::string& name : names) {
      const auto found = std::find(names_.begin(), names_.end(), name);
      if (found != names_.end()) return static_cast<std::size_t>(found - names_.begin());
    }
    if (required) {
      throw InputError(file_, 1, fmt::format("there is no column '{}'", names.front()),
                       "the fields of a message, with their names in the header");
    }
    return none;
  }
  bool next() {
    if (!reader_.next()) return false;
    splitFields(reader_.line(), Separator::comma, fields_);
    if (fields_.size() != names_.size()) {
      throwWrongWidth(fields_.size(), names_.size(), "as in the header", file_, reader_.number());
    }
    return true;
  }
  std::size_t line() const { return reader_.number(); }
  std::string_view field(std::size_t column) const { return fields_[column]; }
  double number(std::size_t column) const { return numberField(fields_[column], names_[column], file_, line()); }
  double numberOrNan(std::size_t column) const {
    return numberOrUnknown(fields_[column], names_[column], file_, line());
  }
  static constexpr std::size_t none = static_cast<std::size_t>(-1);

 private:
  LineReader reader_;
  const std::string& file_;
  std::vector<std::string> names_;
  std::vector<std::string_view> fields_;
};

/// The columns of messages: x y z, quaternion, covariance (which may be absent), times in units of the format.
struct MessageColumns {
  std::size_t time = NamedColumns::none;
  std::array<std::size_t, 3> position{};
  std::array<std::size_t, 4> xyzw{};
  std::vector<std::size_t> covariance = {};
};
void readMessages(NamedColumns& table, const MessageColumns& columns, const TrajectorySource& source,
                  Trajectory& trajectory) {
  const auto& [text, format, options] = source;
  std::vector<double> numbers;
  while (table.next()) {
    if (columns.time != NamedColumns::none) {
      appendTicks(trajectory, table.field(columns.time), format.time_decimals, table.line());
    }
    Eigen::Vector3d position;
    Eigen::Vector4d xyzw;
    for (std::size_t i = 0; i < 3; ++i) position[static_cast<int>(i)] = table.number(columns.position[i]);
    for (std::size_t i = 0; i < 4; ++i) xyzw[static_cast<int>(i)] = table.number(columns.xyzw[i]);
    trajectory.poses.push_back(poseOf(position, xyzw, options.reading.norm_tolerance, trajectory, table.line()));
    trajectory.lines.push_back(table.line());
    if (columns.covariance.empty()) continue;
    numbers.clear();
    for (const std::size_t column : columns.covariance) numbers.push_back(table.numberOrNan(column));
    applySentinels(numbers, *format.layout, options.unmeasured, trajectory);
    appendCovariance(trajectory, {.layout = *format.layout}, numbers, table.line());
  }
  if (!columns.covariance.empty()) trajectory.covariance_source = trajectory.name;
}

/// A field of an array, q[0], q0 or q_0.
std::vector<std::string> arrayNames(const char* array, int k) {
  return {fmt::format("{}[{}]", array, k), fmt::format("{}{}", array, k), fmt::format("{}_{}", array, k)};
}

}  // namespace

/// `rostopic echo -p` of ROS 1: integer nanoseconds, a column for each field.
void readRosCsv(const TrajectorySource& source, Trajectory& trajectory) {
  NamedColumns table(source.text, trajectory.name);
  MessageColumns columns;
  columns.time = table.find({"field.header.stamp", "%time"});
  const bool with_covariance = table.find({"field.pose.pose.position.x"}) != NamedColumns::none;
  const std::string pose = with_covariance ? "field.pose.pose." : "field.pose.";
  for (std::size_t i = 0; i < 3; ++i) {
    columns.position[i] = table.find({pose + "position." + "xyz"[i]}, true);
  }
  for (std::size_t i = 0; i < 4; ++i) columns.xyzw[i] = table.find({pose + "orientation." + "xyzw"[i]}, true);
  if (table.find({"field.pose.covariance0"}) != NamedColumns::none) {
    for (int k = 0; k < 36; ++k) {
      columns.covariance.push_back(table.find({fmt::format("field.pose.covariance{}", k)}, true));
    }
  }
  readMessages(table, columns, source, trajectory);
}

void writeRosCsv(TrajectorySink& sink) {
  std::string& text = sink.text();
  text += "%time,field.header.seq,field.header.stamp,field.header.frame_id";
  const std::string pose = sink.hasCovariances() ? ",field.pose.pose." : ",field.pose.";
  for (const char* field :
       {"position.x", "position.y", "position.z", "orientation.x", "orientation.y", "orientation.z", "orientation.w"}) {
    text += pose + field;
  }
  for (int k = 0; k < 36 && sink.hasCovariances(); ++k) {
    fmt::format_to(std::back_inserter(text), ",field.pose.covariance{}", k);
  }
  text += '\n';
  for (std::size_t i = 0; i < sink.size(); ++i) {
    const std::string stamp = sink.ticks(i);
    text += fmt::format("{},{},{},{}", stamp, i, stamp, sink.frame());
    sink.numbers(sink.position(i), ',');
    sink.numbers(sink.xyzw(i), ',');
    if (sink.hasCovariances()) sink.numbers(sink.messageCovariance(i, 0), ',');
    text += '\n';
  }
}

/// MAVLink's ODOMETRY as CSV of its fields: microseconds, a quaternion with w first.
void readMavlinkCsv(const TrajectorySource& source, Trajectory& trajectory) {
  NamedColumns table(source.text, trajectory.name);
  MessageColumns columns;
  columns.time = table.find({"time_usec", "usec"});
  for (std::size_t i = 0; i < 3; ++i) columns.position[i] = table.find({std::string(1, "xyz"[i])}, true);
  for (std::size_t i = 0; i < 4; ++i) columns.xyzw[i] = table.find(arrayNames("q", static_cast<int>(i + 1) % 4), true);
  for (const char* array : {"pose_covariance", "covariance"}) {
    if (!columns.covariance.empty() || table.find(arrayNames(array, 0)) == NamedColumns::none) continue;
    for (int k = 0; k < 21; ++k) columns.covariance.push_back(table.find(arrayNames(array, k), true));
  }
  readMessages(table, columns, source, trajectory);
}

void writeMavlinkCsv(TrajectorySink& sink) {
  std::string& text = sink.text();
  text += "time_usec,x,y,z,q[0],q[1],q[2],q[3]";
  for (int k = 0; k < 21 && sink.hasCovariances(); ++k) {
    fmt::format_to(std::back_inserter(text), ",pose_covariance[{}]", k);
  }
  text += '\n';
  for (std::size_t i = 0; i < sink.size(); ++i) {
    text += sink.ticks(i);
    sink.numbers(sink.position(i), ',');
    sink.numbers(sink.wxyz(i), ',');
    if (sink.hasCovariances()) sink.numbers(sink.messageCovariance(i, unknown_entry), ',');
    text += '\n';
  }
}

}  // namespace liestat::detail
