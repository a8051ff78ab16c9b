#include <formats/detail/trajectory_formats.hpp>

#include <formats/detail/rows.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <formats/input_error.hpp>
#include <formats/pose_graph.hpp>
#include <formats/text.hpp>
#include <stats/convention_layouts.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

namespace liestat::detail {

// Each pair is in a source of its own, formats/detail/trajectory_*.cpp.
TrajectoryReader readTum, readOpenVins, readKitti, readEuroc, readCsv;
TrajectoryWriter writeTum, writeOpenVins, writeKitti, writeEuroc, writeCsv;
TrajectoryReader readMatrices, readColmap, readVertices, readBag;
TrajectoryReader readRosCsv, readRosJson, readRosYaml, readMavlinkCsv, readMavlinkJson;
TrajectoryWriter writeRosCsv, writeRosJson, writeRosYaml, writeMavlinkCsv, writeMavlinkJson;

namespace {

using Beginning = TrajectoryBeginning;

bool contains(std::string_view text, std::string_view word) { return text.find(word) != std::string_view::npos; }
bool isJson(const Beginning& b) { return !b.line.empty() && (b.line[0] == '{' || b.line[0] == '['); }
bool isMavlinkJson(const Beginning& b) {
  const std::string_view text = b.text.substr(0, 4096);
  return isJson(b) && (contains(text, "mavpackettype") || contains(text, "\"meta\"") || contains(text, "time_usec"));
}

// A row stands above those that would also accept its files.
constexpr TrajectoryFormat trajectory_formats[] = {
    {.name = "mavlink-json",
     .recognises = isMavlinkJson,
     .read = readMavlinkJson,
     .write = writeMavlinkJson,
     .time_decimals = 6,
     .layout = CovarianceLayout::upper21,
     .preset = "mavlink"},
    {.name = "ros-json",
     .recognises = isJson,
     .read = readRosJson,
     .write = writeRosJson,
     .times = TrajectoryTimes::optional,
     .time_decimals = 9,
     .layout = CovarianceLayout::full36},
    {.name = "ros-csv",
     .recognises = [](const Beginning& b) { return contains(b.line, "field.pose."); },
     .read = readRosCsv,
     .write = writeRosCsv,
     .time_decimals = 9,
     .layout = CovarianceLayout::full36},
    {.name = "mavlink-csv",
     .recognises = [](const Beginning& b) { return contains(b.line, "time_usec,") && contains(b.line, ",x,y,z,"); },
     .read = readMavlinkCsv,
     .write = writeMavlinkCsv,
     .time_decimals = 6,
     .layout = CovarianceLayout::upper21,
     .preset = "mavlink"},
    {.name = "ros-yaml",
     .recognises =
         [](const Beginning& b) {
           return b.line == "---" || b.line == "header:" || b.line == "pose:" || b.line == "poses:";
         },
     .read = readRosYaml,
     .write = writeRosYaml,
     .times = TrajectoryTimes::optional,
     .time_decimals = 9,
     .layout = CovarianceLayout::full36},
    // The upper triangles of the rotation's and of the translation's covariance, in this order.
    {.name = "openvins",
     .recognises = [](const Beginning& b) { return b.numbers == 20; },
     .read = readOpenVins,
     .write = writeOpenVins,
     .layout = CovarianceLayout::blocks12,
     .order = CovarianceOrder::rotation_translation},
    {.name = "tum",
     .recognises = [](const Beginning& b) { return b.numbers == 8 && !contains(b.line, ","); },
     .read = readTum,
     .write = writeTum,
     .covariances = CovariancePlace::side_file,
     .takes_layout = true},
    {.name = "kitti",
     .recognises = [](const Beginning& b) { return b.numbers == 12; },
     .read = readKitti,
     .write = writeKitti,
     .times = TrajectoryTimes::none,
     .covariances = CovariancePlace::side_file},
    {.name = "euroc",
     .recognises =
         [](const Beginning& b) {
           return contains(b.line, ",") && (isNanoseconds(b.line.substr(0, b.line.find(','))) ||
                                            (b.numbers >= 8 && contains(b.comment, "[ns]")));
         },
     .read = readEuroc,
     .write = writeEuroc,
     .time_decimals = 9,
     .covariances = CovariancePlace::side_file},
    {.name = "matrix",
     .recognises = [](const Beginning& b) { return b.numbers == 16 || b.numbers == 17 || looksLikeBlocks(b.text); },
     .read = readMatrices,
     .write = nullptr,
     .times = TrajectoryTimes::optional,
     .covariances = CovariancePlace::side_file},
    {.name = "colmap",
     .recognises = [](const Beginning& b) { return looksLikeColmap(b.line); },
     .read = readColmap,
     .write = nullptr,
     .times = TrajectoryTimes::optional,
     .covariances = CovariancePlace::side_file},
    {.name = "g2o",
     .recognises = [](const Beginning& b) { return graphFormatOf(b.text) == GraphFormat::g2o; },
     .read = readVertices,
     .write = nullptr,
     .times = TrajectoryTimes::none,
     .covariances = CovariancePlace::side_file},
    {.name = "toro",
     .recognises = [](const Beginning& b) { return graphFormatOf(b.text) == GraphFormat::toro; },
     .read = readVertices,
     .write = nullptr,
     .times = TrajectoryTimes::none,
     .covariances = CovariancePlace::side_file},
    // Recognised by bytes that are no text, before any of these are asked (isBag).
    {.name = "bag",
     .recognises = [](const Beginning&) { return false; },
     .read = readBag,
     .write = nullptr,
     .time_decimals = 9,
     .layout = CovarianceLayout::full36},
    // Whatever has a header; the reader of features names what it cannot read.
    {.name = "csv",
     .recognises = [](const Beginning& b) { return b.numbers == 0; },
     .read = readCsv,
     .write = writeCsv,
     .times = TrajectoryTimes::optional,
     .covariances = CovariancePlace::header,
     .layout = CovarianceLayout::upper21},
};

}  // namespace

std::span<const TrajectoryFormat> trajectoryFormats() { return trajectory_formats; }

const TrajectoryFormat& trajectoryFormat(std::string_view name) {
  for (const TrajectoryFormat& format : trajectory_formats) {
    if (format.name == name) return format;
  }
  std::vector<std::string> names = trajectoryFormatNames();
  names.erase(names.begin());
  throw OptionError(name, "there is no such format of trajectories", joined(names, ", "));
}

// --- What writers share -----------------------------------------------------------------------------------------------

Eigen::Vector4d TrajectorySink::wxyz(std::size_t i) const {
  const Eigen::Vector4d q = xyzw(i);
  return {q[3], q[0], q[1], q[2]};
}

std::string TrajectorySink::ticks(std::size_t i) {
  const std::string time = seconds(i);
  if (trajectory_.times[i] < 0) {
    throw InputError(trajectory_.name, trajectory_.lines[i], fmt::format("the time is {}", time),
                     fmt::format("0 or more, for the format {}", format_.name));
  }
  bool exact = true;
  std::string whole = ticksOfSeconds(time, format_.time_decimals, exact);
  if (!isWhole(whole)) {
    throw InputError(trajectory_.name, trajectory_.lines[i], fmt::format("the time is {}", time),
                     fmt::format("one that fits into the format {}", format_.name));
  }
  if (!exact) ++result_.n_rounded_times;
  return whole;
}

std::pair<std::string, std::string> TrajectorySink::stamp(std::size_t i) {
  std::string whole = ticks(i);
  if (whole.size() < 10) whole.insert(0, 10 - whole.size(), '0');
  std::string nanoseconds = whole.substr(whole.size() - 9);
  nanoseconds.erase(0, std::min(nanoseconds.find_first_not_of('0'), nanoseconds.size() - 1));
  return {whole.substr(0, whole.size() - 9), nanoseconds};
}

std::vector<double> TrajectorySink::covariance(std::size_t i) const {
  const PackedCovariance packed = packCovariance(convention_, trajectory_.covariances[i]);
  return {packed.numbers().begin(), packed.numbers().end()};
}

std::vector<double> TrajectorySink::messageCovariance(std::size_t i, double first_of_unknown) {
  // The variance that says "not measured" in messages.
  constexpr double not_measured = 1e6;
  Matrix6d C = trajectory_.covariances[i];
  if (C.array().isNaN().all()) {
    std::vector<double> unknown(layoutSize(convention_.layout), 0.0);
    unknown[0] = first_of_unknown;
    return unknown;
  }
  for (int k = 0; k < 6; ++k) {
    if (!std::isnan(C(k, k))) continue;
    C.row(k).setZero();
    C.col(k).setZero();
    C(k, k) = not_measured;
    ++result_.n_marked;
  }
  if (C.array().isNaN().any()) {
    throw InputError(trajectory_.name, trajectory_.lines[i], "some covariances between components are not known",
                     "--assume-uncorrelated, or a format that can say so: messages have no word for it");
  }
  const PackedCovariance packed = packCovariance(convention_, C);
  return {packed.numbers().begin(), packed.numbers().end()};
}

std::string TrajectorySink::frame() const {
  constexpr std::string_view allowed = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_/.-";
  if (trajectory_.frames.empty()) return {};
  const std::string& name = trajectory_.frames.front();
  return name.find_first_not_of(allowed) == std::string::npos ? name : std::string();
}

void TrajectorySink::number(double value) { fmt::format_to(std::back_inserter(text()), "{:.17g}", value); }

void TrajectorySink::list(const std::vector<double>& values) {
  const char* separator = "[";
  for (const double value : values) {
    text() += std::exchange(separator, ", ");
    if (std::isnan(value)) {
      text() += "null";
    } else {
      number(value);
    }
  }
  text() += ']';
}

void TrajectorySink::sideFile() {
  std::string& side = result_.side_file;
  side = conventionHeader(convention_);
  for (std::size_t i = 0; i < size(); ++i) {
    // Rows are matched by the seconds that reading the poses gives.
    bool exact = true;
    if (!hasTimes() || format_.times == TrajectoryTimes::none) {
      side += std::to_string(i);
    } else if (format_.time_decimals > 0) {
      side += secondsOfTicks(ticksOfSeconds(seconds(i), format_.time_decimals, exact), format_.time_decimals);
    } else {
      side += seconds(i);
    }
    for (const double v : covariance(i)) fmt::format_to(std::back_inserter(side), " {:.17g}", v);
    side += '\n';
  }
}

}  // namespace liestat::detail
