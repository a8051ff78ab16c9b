#include <formats/imu.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include <formats/bag.hpp>
#include <formats/detail/bag_file.hpp>
#include <formats/detail/bag_messages.hpp>
#include <formats/detail/trajectory_formats.hpp>
#include <formats/input_error.hpp>
#include <formats/detail/rows.hpp>
#include <formats/numeric_table.hpp>
#include <formats/text.hpp>

namespace liestat {
namespace {

constexpr double unit_norm_tolerance = 1e-3;

void checkOrder(const ImuFile& file, const std::string& name) {
  for (std::size_t i = 1; i < file.samples.size(); ++i)
    detail::requireAscending(file.samples[i - 1].time, file.lines[i - 1], file.samples[i].time, name, file.lines[i]);
}

void checkUnits(const ImuFile& file, const std::string& name) {
  double force = 0, rate = 0;
  for (const ImuSample<double>& s : file.samples) {
    force += s.specific_force.norm() / static_cast<double>(file.samples.size());
    rate += s.angular_rate.norm() / static_cast<double>(file.samples.size());
  }
  if (force > 0.5 && force < 2) {
    throw InputError(name, 0, fmt::format("specific forces are {:.3g} in the mean: in g?", force),
                     "m/s^2, some 9.8 at rest");
  }
  // Rockets have a tenth of this.
  if (force > 500) {
    throw InputError(name, 0, fmt::format("specific forces are {:.4g} in the mean: in mm/s^2?", force),
                     "m/s^2, some 9.8 at rest");
  }
  // The fastest gyroscopes of vehicles end at 35 rad/s.
  if (rate > 35) {
    throw InputError(name, 0, fmt::format("angular rates are {:.3g} in the mean: in degrees a second?", rate), "rad/s");
  }
}

/// A topic of Imu messages.
ImuFile readBagImu(const std::string& path) {
  const BagPath at = bagPath(path);
  std::string name = sourceName(path);
  detail::BagPass pass;
  std::vector<std::string> found;
  std::vector<std::pair<std::int64_t, ImuSample<double>>> readings;
  std::size_t stated = 0, repeated = 0;
  pass.wanted = [&](const BagTopic& b) {
    const bool is_imu =
        detail::bagTypeOf(b.type) == detail::BagType::imu && (b.encoding == "ros1" || b.encoding == "cdr");
    if (at.topic.empty() ? !is_imu : b.name != at.topic) return false;
    if (!is_imu) {
      throw InputError(name, 0, fmt::format("messages of type {} in {}", printable(b.type), printable(b.encoding)),
                       "sensor_msgs/Imu");
    }
    if (found.empty() || found.back() != b.name) found.push_back(b.name);
    return found.size() == 1;
  };
  pass.take = [&](const BagTopic& b, std::int64_t, std::string_view data) {
    const std::size_t number = readings.size() + 1;
    const detail::BagImu imu = detail::imuOf(b, data, name, number);
    if (imu.rate_covariance[0] == -1 || imu.force_covariance[0] == -1) {
      throw InputError(name, number,
                       fmt::format("the sensor has no {}: their covariance begins with -1",
                                   imu.rate_covariance[0] == -1 ? "angular rates" : "accelerations"),
                       "a sensor of both");
    }
    if (!imu.rate.allFinite() || !imu.force.allFinite()) {
      throw InputError(name, number, "a reading is not finite", "rad/s and m/s^2");
    }
    if ((imu.rate_covariance.array() != 0).any() || (imu.force_covariance.array() != 0).any()) ++stated;
    readings.emplace_back(imu.stamp_ns, ImuSample<double>{0, imu.rate, imu.force});
  };
  detail::readBagFile(at.file, largest_text, pass);
  if (found.empty()) detail::requireBagTopic(name, at.topic.empty() ? "of sensor_msgs/Imu" : at.topic, pass.topics);
  if (found.size() > 1) {
    throw InputError(name, 0, fmt::format("{} topics of inertial readings", found.size()),
                     "one of them after a colon: " + joined(found, ", "));
  }
  ImuFile file;
  file.format = "bag", file.notes = pass.notes;
  const auto before = [](const auto& a, const auto& b) { return a.first < b.first; };
  if (!std::is_sorted(readings.begin(), readings.end(), before)) {
    file.notes.emplace_back("the messages are not in the order of their stamps: sorted");
    std::stable_sort(readings.begin(), readings.end(), before);
  }
  for (std::size_t i = 0; i < readings.size(); ++i) {
    auto& [stamp, sample] = readings[i];
    if (i == 0) file.start_ns = stamp;
    sample.time = 1e-9 * static_cast<double>(stamp - file.start_ns);
    if (i > 0 && stamp == readings[i - 1].first && sample.angular_rate == file.samples.back().angular_rate &&
        sample.specific_force == file.samples.back().specific_force) {
      ++repeated;
      continue;
    }
    file.samples.push_back(sample), file.lines.push_back(i + 1);
  }
  if (repeated > 0) file.notes.push_back(fmt::format("{} messages repeat the one before: dropped", repeated));
  if (stated > 0) {
    file.notes.push_back(fmt::format(
        "{} messages state covariances, which are not used: densities of noise are those of --noise or --calibration",
        stated));
  }
  if (file.samples.size() < 2) throw InputError(name, 0, "there is one reading at most", "two at least");
  checkOrder(file, name);
  checkUnits(file, name);
  return file;
}

}  // namespace

ImuFile parseImu(std::string_view text, const std::string& name) {
  ImuFile file;
  LineReader first(text);
  if (!first.next()) throw InputError(name, 0, "the file has no data");
  std::vector<std::string_view> fields;
  splitFields(first.line(), Separator::comma, fields);
  if (detail::isNanoseconds(fields[0])) {
    file.format = "euroc";
    static constexpr const char* columns[] = {"w_x", "w_y", "w_z", "a_x", "a_y", "a_z"};
    detail::StampedRows rows(text, name, columns);
    while (rows.next()) {
      const std::int64_t stamp = rows.stamp();
      if (file.samples.empty()) file.start_ns = stamp;
      file.samples.push_back({1e-9 * static_cast<double>(stamp - file.start_ns), rows.vector(0), rows.vector(3)});
      file.lines.push_back(rows.line());
    }
  } else {
    file.format = "csv";
    const NumericTable table = parseTable(text, name, {"t", "wx", "wy", "wz", "ax", "ay", "az"});
    for (std::size_t i = 0; i < table.rows(); ++i) {
      file.samples.push_back({table(i, 0), Eigen::Vector3d(table(i, 1), table(i, 2), table(i, 3)),
                              Eigen::Vector3d(table(i, 4), table(i, 5), table(i, 6))});
      file.lines.push_back(table.line(i));
    }
  }
  if (file.samples.size() < 2) throw InputError(name, 0, "there is one reading", "two at least");
  checkOrder(file, name);
  checkUnits(file, name);
  return file;
}

ImuFile readImu(const std::string& path) {
  if (isBag(path)) return readBagImu(path);
  const TextFile file = loadText(path);
  return parseImu(file.text, file.name);
}

std::vector<GroundTruth> parseGroundTruth(std::string_view text, const std::string& name, std::int64_t start_ns) {
  static constexpr const char* columns[] = {"p_x", "p_y", "p_z", "q_w", "q_x", "q_y", "q_z", "v_x", "v_y", "v_z"};
  detail::StampedRows rows(text, name, columns);
  std::vector<GroundTruth> truth;
  while (rows.next()) {
    GroundTruth row;
    row.time = 1e-9 * static_cast<double>(rows.stamp() - start_ns);
    if (!truth.empty() && !(row.time > truth.back().time)) {
      throw InputError(name, rows.line(), "the time is not after that of the row before", "times that ascend");
    }
    const Eigen::Quaterniond q(rows.number(3, "q_w"), rows.number(4, "q_x"), rows.number(5, "q_y"),
                               rows.number(6, "q_z"));
    if (!(std::abs(q.norm() - 1) < unit_norm_tolerance)) {
      throw InputError(name, rows.line(), fmt::format("the quaternion has norm {:.6g}", q.norm()), "norm 1");
    }
    row.state = SE23d(SO3d(q), rows.vector(0), rows.vector(7));
    if (rows.has(15)) row.bias = {rows.vector(10), rows.vector(13)};
    truth.push_back(row);
  }
  if (truth.empty()) throw InputError(name, 0, "the file has no data");
  return truth;
}

std::vector<GroundTruth> readGroundTruth(const std::string& path, std::int64_t start_ns) {
  const TextFile file = loadText(path);
  return parseGroundTruth(file.text, file.name, start_ns);
}

std::int64_t firstStamp(std::string_view text, const std::string& name) {
  detail::StampedRows rows(text, name, {});
  if (!rows.next()) throw InputError(name, 0, "the file has no data");
  return rows.stamp();
}

}  // namespace liestat
