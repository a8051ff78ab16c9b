#include <formats/trajectory_writer.hpp>

#include <formats/input_error.hpp>
#include <formats/trajectory_rows.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <vector>

namespace liestat {
namespace {

/// The variance that says "not measured" in ROS messages.
constexpr double not_measured = 1e6;

/// The numbers of a message's covariance. A message has no word for a single unknown entry: a component that is unknown
/// gets the customary large variance, a matrix of which nothing is known what the message says for that.
std::vector<double> messageNumbers(const Trajectory& trajectory, std::size_t i, const Convention& convention,
                                   bool mavlink, TrajectoryText& result) {
  Matrix6d C = trajectory.covariances[i];
  const std::size_t size = layoutSize(convention.layout);
  std::vector<double> numbers(size, 0.0);
  if (C.array().isNaN().all()) {
    if (mavlink) numbers[0] = unknown_entry;
    return numbers;
  }
  bool marked[6] = {};
  for (int k = 0; k < 6; ++k) {
    if (!std::isnan(C(k, k))) continue;
    C.row(k).setZero();
    C.col(k).setZero();
    C(k, k) = not_measured;
    marked[k] = true;
  }
  result.n_marked += static_cast<std::size_t>(std::count(std::begin(marked), std::end(marked), true));
  if (C.array().isNaN().any()) {
    throw InputError(trajectory.name, trajectory.lines[i], "some covariances between components are not known",
                     "--assume-uncorrelated, or a format that can say so: messages have no word for it");
  }
  const PackedCovariance packed = packCovariance(convention, C);
  std::copy(packed.numbers().begin(), packed.numbers().end(), numbers.begin());
  return numbers;
}

/// Writes one format; members append to the text.
class Writer {
 public:
  Writer(const Trajectory& trajectory, std::string_view format, const Convention& convention)
      : trajectory_(trajectory), format_(format), convention_(convention) {}

  TrajectoryText write() {
    const bool needs_time = format_ != "kitti" && format_ != "csv" && format_ != "ros-json" && format_ != "ros-yaml";
    if (needs_time && !trajectory_.hasTimes()) {
      throw InputError(trajectory_.name, 0, "the file has no times",
                       fmt::format("--times with a file of one time for each pose: the format {} needs them", format_));
    }
    if (format_ == "csv") writeCsvHeader();
    if (format_ == "euroc") text_ += "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z []\n";
    if (format_ == "ros-csv") writeRosCsvHeader();
    if (format_ == "mavlink-csv") writeMavlinkCsvHeader();
    if (format_ == "openvins" && trajectory_.hasCovariances()) {
      text_ += "# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 Pr13 Pr22 Pr23 Pr33 Pt11 Pt12 Pt13 Pt22 Pt23 Pt33\n";
    }
    if (format_ == "ros-json" || format_ == "mavlink-json") text_ += "[\n";
    for (std::size_t i = 0; i < trajectory_.size(); ++i) {
      if (format_ == "tum" || format_ == "openvins") writeTum(i);
      if (format_ == "kitti") writeKitti(i);
      if (format_ == "euroc") writeEuroc(i);
      if (format_ == "csv") writeCsv(i);
      if (format_ == "ros-csv") writeRosCsv(i);
      if (format_ == "ros-json") writeRosJson(i);
      if (format_ == "ros-yaml") writeRosYaml(i);
      if (format_ == "mavlink-csv") writeMavlinkCsv(i);
      if (format_ == "mavlink-json") writeMavlinkJson(i);
    }
    if (format_ == "ros-json" || format_ == "mavlink-json") text_ += "]\n";
    const bool beside = format_ == "tum" || format_ == "kitti" || format_ == "euroc";
    if (beside && trajectory_.hasCovariances()) writeSideFile();
    countLostCross();
    return std::move(result_);
  }

 private:
  void number(double value) { fmt::format_to(std::back_inserter(text_), "{:.17g}", value); }
  void numbers(std::initializer_list<double> values, char separator) {
    for (const double value : values) text_ += separator, number(value);
  }
  Eigen::Vector3d position(std::size_t i) const { return trajectory_.poses[i].translation(); }
  Eigen::Vector4d xyzw(std::size_t i) const { return trajectory_.poses[i].unit_quaternion().coeffs(); }
  std::string ticks(std::size_t i, std::size_t decimals) {
    if (trajectory_.times[i] < 0) {
      throw InputError(trajectory_.name, trajectory_.lines[i], fmt::format("the time is {}", trajectory_.time_texts[i]),
                       fmt::format("0 or more, for the format {}", format_));
    }
    bool exact = true;
    const std::string text = ticksOfSeconds(trajectory_.time_texts[i], decimals, exact);
    if (!isWhole(text)) {
      throw InputError(trajectory_.name, trajectory_.lines[i], fmt::format("the time is {}", trajectory_.time_texts[i]),
                       fmt::format("one that fits into the format {}", format_));
    }
    if (!exact) ++result_.n_rounded_times;
    return text;
  }
  std::vector<double> covarianceNumbers(std::size_t i) const {
    const PackedCovariance packed = packCovariance(convention_, trajectory_.covariances[i]);
    return {packed.numbers().begin(), packed.numbers().end()};
  }
  /// The frame's name, if it is of the characters that ROS allows.
  std::string frame() const {
    constexpr std::string_view allowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_/.-";
    if (trajectory_.frames.empty()) return {};
    const std::string& name = trajectory_.frames.front();
    return name.find_first_not_of(allowed) == std::string::npos ? name : std::string();
  }

  void writeTum(std::size_t i) {
    const Eigen::Vector3d p = position(i);
    const Eigen::Vector4d q = xyzw(i);
    text_ += trajectory_.time_texts[i];
    numbers({p[0], p[1], p[2], q[0], q[1], q[2], q[3]}, ' ');
    if (format_ == "openvins" && trajectory_.hasCovariances()) {
      for (const double v : covarianceNumbers(i)) text_ += ' ', number(v);
    }
    text_ += '\n';
  }
  void writeKitti(std::size_t i) {
    const Eigen::Matrix<double, 3, 4> T = trajectory_.poses[i].matrix3x4();
    for (int k = 0; k < 12; ++k) {
      if (k > 0) text_ += ' ';
      number(T(k / 4, k % 4));
    }
    text_ += '\n';
  }
  void writeEuroc(std::size_t i) {
    const Eigen::Vector3d p = position(i);
    const Eigen::Vector4d q = xyzw(i);
    text_ += ticks(i, 9);
    numbers({p[0], p[1], p[2], q[3], q[0], q[1], q[2]}, ',');
    text_ += '\n';
  }

  void writeCsvHeader() {
    if (trajectory_.hasCovariances() && convention_ != Convention{.layout = CovarianceLayout::upper21}) {
      text_ += conventionHeader(convention_);
    }
    text_ += trajectory_.hasTimes() ? "t,tx,ty,tz,qx,qy,qz,qw" : "tx,ty,tz,qx,qy,qz,qw";
    for (int i = 0; i < 6 && trajectory_.hasCovariances(); ++i) {
      for (int j = i; j < 6; ++j) fmt::format_to(std::back_inserter(text_), ",cov_{}{}", i, j);
    }
    text_ += '\n';
  }
  void writeCsv(std::size_t i) {
    const Eigen::Vector3d p = position(i);
    const Eigen::Vector4d q = xyzw(i);
    if (trajectory_.hasTimes()) text_ += trajectory_.time_texts[i] + ",";
    number(p[0]);
    numbers({p[1], p[2], q[0], q[1], q[2], q[3]}, ',');
    if (trajectory_.hasCovariances()) {
      for (const double v : covarianceNumbers(i)) text_ += ',', number(v);
    }
    text_ += '\n';
  }

  void writeRosCsvHeader() {
    text_ += "%time,field.header.seq,field.header.stamp,field.header.frame_id";
    const std::string pose = trajectory_.hasCovariances() ? ",field.pose.pose." : ",field.pose.";
    for (const char* field : {"position.x", "position.y", "position.z", "orientation.x", "orientation.y",
                              "orientation.z", "orientation.w"}) {
      text_ += pose + field;
    }
    for (int k = 0; k < 36 && trajectory_.hasCovariances(); ++k) {
      fmt::format_to(std::back_inserter(text_), ",field.pose.covariance{}", k);
    }
    text_ += '\n';
  }
  void writeRosCsv(std::size_t i) {
    const Eigen::Vector3d p = position(i);
    const Eigen::Vector4d q = xyzw(i);
    const std::string stamp = ticks(i, 9);
    text_ += fmt::format("{},{},{},{}", stamp, i, stamp, frame());
    numbers({p[0], p[1], p[2], q[0], q[1], q[2], q[3]}, ',');
    if (trajectory_.hasCovariances()) {
      for (const double v : messageNumbers(trajectory_, i, convention_, false, result_)) text_ += ',', number(v);
    }
    text_ += '\n';
  }

  /// Seconds and nanoseconds of a stamp.
  std::pair<std::string, std::string> stamp(std::size_t i) {
    std::string whole = ticks(i, 9);
    if (whole.size() < 10) whole.insert(0, 10 - whole.size(), '0');
    std::string nanoseconds = whole.substr(whole.size() - 9);
    nanoseconds.erase(0, std::min(nanoseconds.find_first_not_of('0'), nanoseconds.size() - 1));
    return {whole.substr(0, whole.size() - 9), nanoseconds};
  }
  void writeRosJson(std::size_t i) {
    const Eigen::Vector3d p = position(i);
    const Eigen::Vector4d q = xyzw(i);
    const auto out = std::back_inserter(text_);
    text_ += "{";
    if (trajectory_.hasTimes()) {
      const auto [seconds, nanoseconds] = stamp(i);
      fmt::format_to(out, R"("header": {{"stamp": {{"sec": {}, "nanosec": {}}}, "frame_id": "{}"}}, )", seconds,
                     nanoseconds, frame());
    }
    const bool with = trajectory_.hasCovariances();
    fmt::format_to(out,
                   R"("pose": {}{{"position": {{"x": {:.17g}, "y": {:.17g}, "z": {:.17g}}}, "orientation": )"
                   R"({{"x": {:.17g}, "y": {:.17g}, "z": {:.17g}, "w": {:.17g}}}}})",
                   with ? "{\"pose\": " : "", p[0], p[1], p[2], q[0], q[1], q[2], q[3]);
    if (with) {
      text_ += ", \"covariance\": ";
      writeList(messageNumbers(trajectory_, i, convention_, false, result_));
      text_ += "}";
    }
    text_ += i + 1 < trajectory_.size() ? "},\n" : "}\n";
  }
  /// A JSON list; null for NaN.
  void writeList(const std::vector<double>& values) {
    text_ += '[';
    for (std::size_t k = 0; k < values.size(); ++k) {
      if (k > 0) text_ += ", ";
      if (std::isnan(values[k])) {
        text_ += "null";
      } else {
        number(values[k]);
      }
    }
    text_ += ']';
  }
  void writeRosYaml(std::size_t i) {
    const Eigen::Vector3d p = position(i);
    const Eigen::Vector4d q = xyzw(i);
    const auto out = std::back_inserter(text_);
    if (trajectory_.hasTimes()) {
      const auto [seconds, nanoseconds] = stamp(i);
      fmt::format_to(out, "header:\n  stamp:\n    sec: {}\n    nanosec: {}\n  frame_id: '{}'\n", seconds, nanoseconds,
                     frame());
    }
    const bool with = trajectory_.hasCovariances();
    const char* const indent = with ? "    " : "  ";
    text_ += with ? "pose:\n  pose:\n" : "pose:\n";
    fmt::format_to(out, "{0}position:\n{0}  x: {1:.17g}\n{0}  y: {2:.17g}\n{0}  z: {3:.17g}\n", indent, p[0], p[1],
                   p[2]);
    fmt::format_to(out, "{0}orientation:\n{0}  x: {1:.17g}\n{0}  y: {2:.17g}\n{0}  z: {3:.17g}\n{0}  w: {4:.17g}\n",
                   indent, q[0], q[1], q[2], q[3]);
    if (with) {
      text_ += "  covariance:\n";
      for (const double v : messageNumbers(trajectory_, i, convention_, false, result_)) {
        text_ += "  - ";
        number(v);
        text_ += '\n';
      }
    }
    text_ += "---\n";
  }

  void writeMavlinkCsvHeader() {
    text_ += "time_usec,x,y,z,q[0],q[1],q[2],q[3]";
    for (int k = 0; k < 21 && trajectory_.hasCovariances(); ++k) {
      fmt::format_to(std::back_inserter(text_), ",pose_covariance[{}]", k);
    }
    text_ += '\n';
  }
  void writeMavlinkCsv(std::size_t i) {
    const Eigen::Vector3d p = position(i);
    const Eigen::Vector4d q = xyzw(i);
    text_ += ticks(i, 6);
    numbers({p[0], p[1], p[2], q[3], q[0], q[1], q[2]}, ',');
    if (trajectory_.hasCovariances()) {
      for (const double v : messageNumbers(trajectory_, i, convention_, true, result_)) text_ += ',', number(v);
    }
    text_ += '\n';
  }
  void writeMavlinkJson(std::size_t i) {
    const Eigen::Vector3d p = position(i);
    const Eigen::Vector4d q = xyzw(i);
    fmt::format_to(std::back_inserter(text_),
                   R"({{"mavpackettype": "ODOMETRY", "time_usec": {}, "x": {:.17g}, "y": {:.17g}, "z": {:.17g}, )"
                   R"("q": [{:.17g}, {:.17g}, {:.17g}, {:.17g}])",
                   ticks(i, 6), p[0], p[1], p[2], q[3], q[0], q[1], q[2]);
    if (trajectory_.hasCovariances()) {
      text_ += ", \"pose_covariance\": ";
      writeList(messageNumbers(trajectory_, i, convention_, true, result_));
    }
    text_ += i + 1 < trajectory_.size() ? "},\n" : "}\n";
  }

  void writeSideFile() {
    std::string& side = result_.side_file;
    side = conventionHeader(convention_);
    for (std::size_t i = 0; i < trajectory_.size(); ++i) {
      // The rows of EuRoC's files are matched by the seconds that reading them gives.
      if (!trajectory_.hasTimes() || format_ == "kitti") {
        side += std::to_string(i);
      } else if (format_ == "euroc") {
        bool exact = true;
        side += secondsOfTicks(ticksOfSeconds(trajectory_.time_texts[i], 9, exact), 9);
      } else {
        side += trajectory_.time_texts[i];
      }
      for (const double v : covarianceNumbers(i)) fmt::format_to(std::back_inserter(side), " {:.17g}", v);
      side += '\n';
    }
  }

  /// Covariances between translation and rotation that are known, not zero, and have no place in the layout.
  void countLostCross() {
    if (convention_.layout != CovarianceLayout::blocks12 && convention_.layout != CovarianceLayout::diag6) return;
    for (const Matrix6d& C : trajectory_.covariances) {
      if ((C.topRightCorner<3, 3>().array().abs() > 0).any()) ++result_.n_lost_cross;
    }
  }

  const Trajectory& trajectory_;
  std::string_view format_;
  Convention convention_;
  TrajectoryText result_;
  std::string& text_ = result_.text;
};

}  // namespace

bool isSelfDescribing(std::string_view format) {
  return format == "csv" || format == "tum" || format == "kitti" || format == "euroc";
}

Convention conventionFor(std::string_view format, Convention convention) {
  if (format == "openvins") {
    convention.order = CovarianceOrder::rotation_translation;
    convention.layout = CovarianceLayout::blocks12;
  } else if (format == "csv" || format.substr(0, 7) == "mavlink") {
    convention.layout = CovarianceLayout::upper21;
  } else if (format.substr(0, 3) == "ros") {
    convention.layout = CovarianceLayout::full36;
  }
  return convention;
}

Convention conventionToWrite(std::string_view format, const std::string& asked, const std::string& caller,
                             std::string_view option) {
  if (!asked.empty()) {
    Convention given = conventionNamed(asked, option);
    const bool names_layout = asked.find("layout=") != std::string::npos;
    if (isSelfDescribing(format) && !names_layout) given.layout = CovarianceLayout::upper21;
    const Convention c = conventionFor(format, given);
    if (c.layout != given.layout && names_layout) {
      throw InputError(caller, 0, fmt::format("{} {}, but the format {} has its own layout", option, asked, format),
                       std::string(name(c.layout)));
    }
    return c;
  }
  if (isSelfDescribing(format)) return conventionFor(format, {.layout = CovarianceLayout::upper21});
  if (format.rfind("mavlink", 0) == 0) return *conventionPreset("mavlink");
  throw InputError(caller, 0, fmt::format("the format {} cannot say what its covariances mean", format),
                   fmt::format("{} with a convention (docs/which_convention.md)", option));
}

std::vector<std::string> notesOf(const TrajectoryText& text, std::string_view format, const Convention& convention) {
  std::vector<std::string> notes;
  if (text.n_rounded_times > 0) {
    notes.push_back(fmt::format("{} times have digits that the format {} has not; they were cut off",
                                text.n_rounded_times, format));
  }
  if (text.n_lost_cross > 0) {
    notes.push_back(fmt::format("{} covariances have a cross block, for which the layout {} has no place",
                                text.n_lost_cross, name(convention.layout)));
  }
  if (text.n_marked > 0) {
    notes.push_back(fmt::format("{} unknown components are written as a variance of 1e6", text.n_marked));
  }
  return notes;
}

TrajectoryText formatTrajectory(const Trajectory& trajectory, std::string_view format, const Convention& convention) {
  return Writer(trajectory, format, conventionFor(format, convention)).write();
}

}  // namespace liestat
