// Messages of ROS and MAVLink in JSON and YAML: a message, a list of messages, one message per line (JSON), or one per
// document (YAML); of ROS PoseWithCovarianceStamped, Odometry, PoseStamped, Path, of MAVLink ODOMETRY and
// VISION_POSITION_ESTIMATE.
#include <formats/input_error.hpp>
#include <formats/text.hpp>
#include <formats/detail/trajectory_formats.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <formats/detail/yaml_values.hpp>
#include <lie/euler.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

namespace liestat::detail {
namespace {

using Json = nlohmann::json;

/// A value as messages show it. Lists and objects by their name: dumping one may go as deep as it is nested.
std::string shown(const Json& json) {
  if (json.is_structured()) return std::string("an ") + json.type_name();
  return printable(json.dump(-1, ' ', false, Json::error_handler_t::replace));
}

/// A part of a message and what error messages call it by.
struct Part {
  const Json& json;
  std::string name;
  const std::string& file;
  std::size_t line;

  [[noreturn]] void complain(const std::string& found, const std::string& expected) const {
    throw InputError(file, line, name + " " + found, expected);
  }
  bool has(const char* key) const { return json.is_object() && json.contains(key); }
  std::optional<Part> find(std::initializer_list<const char*> keys) const {
    for (const char* key : keys) {
      if (has(key)) return Part{json[key], name + "." + key, file, line};
    }
    return std::nullopt;
  }
  Part at(std::initializer_list<const char*> keys) const {
    if (const auto part = find(keys)) return *part;
    complain(fmt::format("has no '{}'", *keys.begin()), "a message with this field");
  }
  /// A finite number, or NaN for null and nan if that is allowed. YAML's scalars are texts.
  double number(bool may_be_unknown = false) const {
    double value = unknown_entry;
    if (json.is_number()) {
      value = json.get<double>();
    } else if (json.is_string()) {
      std::string_view text = json.get_ref<const std::string&>();
      if (text == ".nan" || text == ".NaN") text = "nan";
      if (parseNumber(text, value) == NumberKind::no_number) complain("is '" + printable(text) + "'", "a number");
    } else if (!json.is_null()) {
      complain("is " + shown(json), "a number");
    }
    if (std::isfinite(value) || (may_be_unknown && std::isnan(value))) return value;
    complain("is not finite", may_be_unknown ? "a finite number, or nan for what is unknown" : "a finite number");
  }
  /// The digits of a whole number.
  std::string whole() const {
    std::string digits = json.is_string()           ? json.get<std::string>()
                         : json.is_number_integer() ? json.dump()
                                                    : std::string();
    if (!isWhole(digits)) complain("is " + shown(json), "a whole number of 0 or more");
    return digits;
  }
  std::vector<double> list(bool may_be_unknown) const {
    if (!json.is_array()) complain("is no list", "a list of numbers");
    std::vector<double> values;
    for (const Json& entry : json) values.push_back(Part{entry, name, file, line}.number(may_be_unknown));
    return values;
  }
  template <int N>
  Eigen::Matrix<double, N, 1> vector(const char* axes) const {
    Eigen::Matrix<double, N, 1> v;
    for (int i = 0; i < N; ++i) {
      const char key[] = {axes[i], '\0'};
      v[i] = at({key}).number();
    }
    return v;
  }
};

/// Bare NaN, which Python writes and JSON does not have, as null.
std::string withoutNan(std::string_view text) {
  std::string result(text);
  bool quoted = false;
  for (std::size_t i = 0; i + 2 < result.size(); ++i) {
    if (quoted && result[i] == '\\') {
      ++i;
      continue;
    }
    if (result[i] == '"') quoted = !quoted;
    if (!quoted && result.compare(i, 3, "NaN") == 0) result.replace(i, 3, "null");
  }
  return result;
}

Json parsed(std::string_view text, const std::string& file, std::size_t first_line) {
  const std::string json = withoutNan(text);
  const auto line_of = [&](std::size_t at) {
    const auto end = json.begin() + static_cast<std::ptrdiff_t>(std::min(at, json.size()));
    return first_line + static_cast<std::size_t>(std::count(json.begin(), end, '\n'));
  };
  try {
    return Json::parse(json);
  } catch (const Json::parse_error& error) {
    throw InputError(file, line_of(error.byte), "this is no JSON",
                     "a message, a list of messages, or one message per line");
  } catch (const Json::out_of_range& error) {
    // A number beyond double's; the library's message ends with it, in quotes, and says no place.
    const std::string_view message = error.what();
    const std::size_t open = message.find('\''), close = message.rfind('\'');
    const std::string number(open < close ? message.substr(open + 1, close - open - 1) : message);
    throw InputError(file, line_of(json.find(number)), "a number is '" + printable(number) + "'", "a finite number");
  }
}

/// Calls a function with each message of a text and its line: a message, a list, or a message per line.
template <class Take>
void forEachMessage(std::string_view text, const std::string& file, Take&& take) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  const std::size_t end = std::min(text.find('\n', first), text.size());
  const std::string_view line = text.substr(first, end - first);
  const bool by_line = line.front() == '{' && Json::accept(withoutNan(line));
  if (!by_line) {
    const auto before =
        static_cast<std::size_t>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(first), '\n'));
    const Json whole = parsed(text, file, before + 1);
    if (!whole.is_array()) return take(whole, before + 1, std::string("the message"));
    for (std::size_t i = 0; i < whole.size(); ++i) take(whole[i], 0, fmt::format("message {}", i));
    return;
  }
  std::size_t number = 0;
  while (!text.empty()) {
    const std::size_t stop = text.find('\n');
    const std::string_view row = text.substr(0, stop);
    text.remove_prefix(stop == std::string_view::npos ? text.size() : stop + 1);
    ++number;
    if (row.find_first_not_of(" \t\r") == std::string_view::npos) continue;
    take(parsed(row, file, number), number, std::string("the message"));
  }
}

// --- ROS --------------------------------------------------------------------------------------------------------------

/// Seconds and nanoseconds of a stamp, under their names of ROS 1 or 2, with all digits.
void readStamp(const Part& header, Trajectory& trajectory) {
  const Part stamp = header.at({"stamp"});
  const std::string nanoseconds = stamp.at({"nanosec", "nsecs", "nsec"}).whole();
  if (nanoseconds.size() > 9) stamp.complain("has " + printable(nanoseconds) + " nanoseconds", "fewer than 10^9");
  appendTime(trajectory,
             stamp.at({"sec", "secs"}).whole() + "." + std::string(9 - nanoseconds.size(), '0') + nanoseconds,
             header.line);
}

void readRosPose(const Part& pose, Trajectory& trajectory, const TrajectoryOptions& options) {
  const bool transform = pose.has("translation");
  const Eigen::Vector3d position = pose.at({transform ? "translation" : "position"}).vector<3>("xyz");
  const Eigen::Vector4d xyzw = pose.at({transform ? "rotation" : "orientation"}).vector<4>("xyzw");
  trajectory.poses.push_back(poseOf(position, xyzw, options.reading.norm_tolerance, trajectory, pose.line));
  trajectory.lines.push_back(pose.line);
}

/// A message, in a Path or an envelope (`msg`) or by itself.
void readRosMessage(const Part& message, Trajectory& trajectory, const TrajectoryOptions& options, int depth = 0) {
  if (depth > 3) message.complain("is nested too deep", "a message in a list or an envelope");
  if (const auto wrapped = message.find({"msg"})) return readRosMessage(*wrapped, trajectory, options, depth + 1);
  if (const auto list = message.find({"poses"})) {
    if (!list->json.is_array()) list->complain("is no list", "a list of poses");
    for (std::size_t i = 0; i < list->json.size(); ++i) {
      readRosMessage({list->json[i], fmt::format("{}[{}]", list->name, i), list->file, list->line}, trajectory, options,
                     depth + 1);
    }
    return;
  }
  const std::size_t n = trajectory.size();
  const bool has_time = message.has("header");
  if (n > 0 && has_time != trajectory.hasTimes()) {
    message.complain(has_time ? "has a header" : "has no header", "all messages with one, or none");
  }
  if (const auto header = message.find({"header"})) {
    readStamp(*header, trajectory);
    if (n == 0) {
      for (const Part* part : {&*header, &message}) {
        const auto frame = part->find({"frame_id", "child_frame_id"});
        if (frame && frame->json.is_string()) trajectory.frames.push_back(printable(frame->json.get<std::string>()));
      }
    }
  }
  const auto outer = message.find({"pose", "transform"});
  const Part pose = outer ? *outer : message;
  const Part inner = pose.has("pose") ? pose.at({"pose"}) : pose;
  readRosPose(inner, trajectory, options);
  const auto covariance = pose.find({"covariance"});
  if (n > 0 && covariance.has_value() != trajectory.hasCovariances()) {
    message.complain(covariance ? "has a covariance" : "has no covariance", "all messages with one, or none");
  }
  if (!covariance) return;
  std::vector<double> numbers = covariance->list(true);
  if (numbers.size() != 36) {
    covariance->complain(fmt::format("has {} numbers", numbers.size()), "36, row by row");
  }
  applySentinels(numbers, CovarianceLayout::full36, options.unmeasured, trajectory);
  appendCovariance(trajectory, {}, numbers, covariance->line);
  trajectory.covariance_source = trajectory.name;
}

Json jsonOf(const YAML::Node& node) {
  if (node.IsScalar()) return node.Scalar();
  if (node.IsSequence()) {
    Json list = Json::array();
    for (const YAML::Node& entry : node) list.push_back(jsonOf(entry));
    return list;
  }
  if (!node.IsMap()) return nullptr;
  Json map = Json::object();
  for (const auto& entry : node) {
    if (entry.first.IsScalar()) map[entry.first.Scalar()] = jsonOf(entry.second);
  }
  return map;
}

// --- MAVLink ----------------------------------------------------------------------------------------------------------

void readMavlinkMessage(const Part& message, Trajectory& trajectory, const TrajectorySource& source) {
  const auto& [text, format, options] = source;
  constexpr std::array types{"ODOMETRY", "VISION_POSITION_ESTIMATE", "ATT_POS_MOCAP"};
  const auto meta = message.find({"meta"});
  const auto type = meta ? meta->find({"type"}) : message.find({"mavpackettype"});
  const auto data = message.find({"data"});
  if (type && type->json.is_string()) {
    const auto& name = type->json.get_ref<const std::string&>();
    if (std::find(types.begin(), types.end(), name) == types.end()) return;
  }
  const Part fields = data ? *data : message;
  appendTicks(trajectory, fields.at({"time_usec", "usec"}).whole(), format.time_decimals, fields.line);
  const Eigen::Vector3d position = fields.vector<3>("xyz");
  if (const auto q = fields.find({"q"})) {
    const std::vector<double> wxyz = q->list(false);
    if (wxyz.size() != 4) q->complain(fmt::format("has {} numbers", wxyz.size()), "4, w first");
    trajectory.poses.push_back(poseOf(position, Eigen::Vector4d(wxyz[1], wxyz[2], wxyz[3], wxyz[0]),
                                      options.reading.norm_tolerance, trajectory, fields.line));
  } else {
    trajectory.poses.emplace_back(
        fromRollPitchYaw(fields.at({"roll"}).number(), fields.at({"pitch"}).number(), fields.at({"yaw"}).number()),
        position);
  }
  trajectory.lines.push_back(fields.line);
  std::vector<double> numbers(21, unknown_entry);
  if (const auto covariance = fields.find({"pose_covariance", "covariance"})) {
    numbers = covariance->list(true);
    if (numbers.size() != 21) {
      covariance->complain(fmt::format("has {} numbers", numbers.size()), "21, the upper triangle row by row");
    }
    applySentinels(numbers, *format.layout, options.unmeasured, trajectory);
    trajectory.covariance_source = trajectory.name;
  }
  appendCovariance(trajectory, {.layout = *format.layout}, numbers, fields.line);
  if (trajectory.size() > 1) return;
  for (const char* key : {"frame_id", "child_frame_id"}) {
    if (const auto frame = fields.find({key})) trajectory.frames.push_back("MAV_FRAME " + shown(frame->json));
  }
}

}  // namespace

void readRosJson(const TrajectorySource& source, Trajectory& trajectory) {
  forEachMessage(source.text, trajectory.name, [&](const Json& json, std::size_t line, const std::string& name) {
    readRosMessage({json, name, trajectory.name, line}, trajectory, source.options);
  });
}

void readMavlinkJson(const TrajectorySource& source, Trajectory& trajectory) {
  forEachMessage(source.text, trajectory.name, [&](const Json& json, std::size_t line, const std::string& name) {
    readMavlinkMessage({json, name, trajectory.name, line}, trajectory, source);
  });
  if (trajectory.covariance_source.empty()) trajectory.covariances.clear();
}

void readRosYaml(const TrajectorySource& source, Trajectory& trajectory) {
  std::string_view text = source.text;
  // One document at a time: what yaml-cpp takes for a document grows faster than its length.
  std::size_t line = 1, begin_line = 1;
  std::string document;
  const auto take = [&] {
    if (document.find_first_not_of(" \t\r\n") != std::string::npos) {
      Json json;
      try {
        refuseAliases(document, trajectory.name, begin_line);
        json = jsonOf(YAML::Load(document));
      } catch (const YAML::Exception& error) {
        throw InputError(trajectory.name, begin_line + static_cast<std::size_t>(std::max(error.mark.line, 0)),
                         "YAML: " + printable(error.msg, 200));
      }
      const bool list = json.is_array();
      for (const Json& message : list ? json : Json::array({json})) {
        readRosMessage({message, "the message", trajectory.name, begin_line}, trajectory, source.options);
      }
    }
    document.clear();
  };
  while (!text.empty()) {
    const std::size_t stop = text.find('\n');
    const std::string_view row = text.substr(0, stop);
    text.remove_prefix(stop == std::string_view::npos ? text.size() : stop + 1);
    if (row.substr(0, 3) == "---") {
      take();
      begin_line = line + 1;
    } else {
      document.append(row).push_back('\n');
      if (document.size() > 1000000) {
        throw InputError(trajectory.name, begin_line, "this YAML document has more than a million bytes",
                         "a message, with '---' before the next one");
      }
    }
    ++line;
  }
  take();
}

void writeRosJson(TrajectorySink& sink) {
  const auto out = std::back_inserter(sink.text());
  sink.text() += "[\n";
  for (std::size_t i = 0; i < sink.size(); ++i) {
    const Eigen::Vector3d p = sink.position(i);
    const Eigen::Vector4d q = sink.xyzw(i);
    const bool with = sink.hasCovariances();
    sink.text() += "{";
    if (sink.hasTimes()) {
      const auto [seconds, nanoseconds] = sink.stamp(i);
      fmt::format_to(out, R"("header": {{"stamp": {{"sec": {}, "nanosec": {}}}, "frame_id": "{}"}}, )", seconds,
                     nanoseconds, sink.frame());
    }
    fmt::format_to(out,
                   R"("pose": {}{{"position": {{"x": {:.17g}, "y": {:.17g}, "z": {:.17g}}}, "orientation": )"
                   R"({{"x": {:.17g}, "y": {:.17g}, "z": {:.17g}, "w": {:.17g}}}}})",
                   with ? "{\"pose\": " : "", p[0], p[1], p[2], q[0], q[1], q[2], q[3]);
    if (with) {
      sink.text() += ", \"covariance\": ";
      sink.list(sink.messageCovariance(i, 0));
      sink.text() += "}";
    }
    sink.text() += i + 1 < sink.size() ? "},\n" : "}\n";
  }
  sink.text() += "]\n";
}

void writeRosYaml(TrajectorySink& sink) {
  const auto out = std::back_inserter(sink.text());
  const bool with = sink.hasCovariances();
  const char* const indent = with ? "    " : "  ";
  for (std::size_t i = 0; i < sink.size(); ++i) {
    const Eigen::Vector3d p = sink.position(i);
    const Eigen::Vector4d q = sink.xyzw(i);
    if (sink.hasTimes()) {
      const auto [seconds, nanoseconds] = sink.stamp(i);
      fmt::format_to(out, "header:\n  stamp:\n    sec: {}\n    nanosec: {}\n  frame_id: '{}'\n", seconds, nanoseconds,
                     sink.frame());
    }
    sink.text() += with ? "pose:\n  pose:\n" : "pose:\n";
    fmt::format_to(out, "{0}position:\n{0}  x: {1:.17g}\n{0}  y: {2:.17g}\n{0}  z: {3:.17g}\n", indent, p[0], p[1],
                   p[2]);
    fmt::format_to(out, "{0}orientation:\n{0}  x: {1:.17g}\n{0}  y: {2:.17g}\n{0}  z: {3:.17g}\n{0}  w: {4:.17g}\n",
                   indent, q[0], q[1], q[2], q[3]);
    if (with) {
      sink.text() += "  covariance:\n";
      for (const double v : sink.messageCovariance(i, 0)) fmt::format_to(out, "  - {:.17g}\n", v);
    }
    sink.text() += "---\n";
  }
}

void writeMavlinkJson(TrajectorySink& sink) {
  sink.text() += "[\n";
  for (std::size_t i = 0; i < sink.size(); ++i) {
    const Eigen::Vector3d p = sink.position(i);
    const Eigen::Vector4d q = sink.wxyz(i);
    fmt::format_to(std::back_inserter(sink.text()),
                   R"({{"mavpackettype": "ODOMETRY", "time_usec": {}, "x": {:.17g}, "y": {:.17g}, "z": {:.17g}, )"
                   R"("q": [{:.17g}, {:.17g}, {:.17g}, {:.17g}])",
                   sink.ticks(i), p[0], p[1], p[2], q[0], q[1], q[2], q[3]);
    if (sink.hasCovariances()) {
      sink.text() += ", \"pose_covariance\": ";
      sink.list(sink.messageCovariance(i, unknown_entry));
    }
    sink.text() += i + 1 < sink.size() ? "},\n" : "}\n";
  }
  sink.text() += "]\n";
}

}  // namespace liestat::detail
