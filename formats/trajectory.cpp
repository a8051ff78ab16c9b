#include <formats/trajectory.hpp>

#include <formats/feature_values.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/text.hpp>
#include <formats/trajectory_rows.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <utility>

namespace liestat {
namespace {

// --- Formats that the reader of features knows ----------------------------------------------------------------------

/// The columns of the first line of a CSV file, under our names.
std::vector<std::string> csvColumns(std::string_view text, const TrajectoryOptions& options) {
  LineReader reader(text);
  std::vector<std::string> names;
  if (!reader.next()) return names;
  std::vector<std::string_view> fields;
  splitFields(reader.line(), Separator::comma_or_blanks, fields);
  for (const std::string_view field : fields) {
    names.emplace_back(field == "time" || field == "timestamp" ? "t" : field);
    for (const std::string& wish : options.reading.columns) {
      const std::size_t sign = wish.find('=');
      if (sign != std::string::npos && wish.substr(sign + 1) == field) names.back() = wish.substr(0, sign);
    }
  }
  return names;
}

/// Reads the fields of the rows whose poses have been read: those of a time, and of a covariance.
void readFields(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options) {
  const bool csv = trajectory.format == "csv";
  const std::vector<std::string> columns = csv ? csvColumns(text, options) : std::vector<std::string>();
  const auto place = [&](const std::string& column) {
    return static_cast<std::size_t>(std::find(columns.begin(), columns.end(), column) - columns.begin());
  };
  const std::size_t time = csv ? place("t") : 0;
  const bool has_time = trajectory.format != "kitti" && (!csv || time < columns.size());
  std::vector<std::size_t> covariance;
  if (csv && std::any_of(columns.begin(), columns.end(), [](const auto& c) { return c.rfind("cov_", 0) == 0; })) {
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) {
        const std::string column = fmt::format("cov_{}{}", i, j);
        covariance.push_back(place(column));
        if (covariance.back() == columns.size()) {
          throw InputError(trajectory.name, 0, fmt::format("there is no column '{}'", column),
                           "the upper triangle cov_00 ... cov_55");
        }
      }
    }
  }
  LineReader reader(text);
  std::vector<std::string_view> fields;
  std::vector<double> numbers;
  for (const std::size_t line : trajectory.lines) {
    while (reader.number() < line && reader.next()) {
    }
    splitFields(reader.line(), Separator::comma_or_blanks, fields);
    if (has_time && trajectory.format == "euroc") {
      appendTicks(trajectory, fields[0], 9, line);
    } else if (has_time) {
      appendTime(trajectory, fields[time], line);
    }
    if (covariance.empty()) continue;
    numbers.clear();
    for (std::size_t k = 0; k < covariance.size(); ++k) {
      numbers.push_back(numberOrUnknown(fields[covariance[k]], columns[covariance[k]], trajectory.name, line));
    }
    appendCovariance(trajectory, {.layout = CovarianceLayout::upper21}, numbers, line);
  }
}

void readAsFeatures(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options,
                    const std::string& format) {
  ReadingOptions reading = options.reading;
  reading.format = format;
  reading.without_covariances = true;
  const FeatureFile file = readFeatures(text, trajectory.name, reading);
  if (file.kind != Feature::frame) {
    throw InputError(trajectory.name, file.lines.front(),
                     fmt::format("the file has {}", info(file.kind).plural),
                     "poses: a translation beside each rotation");
  }
  trajectory.format = file.format;
  trajectory.lines = file.lines;
  trajectory.poses = featuresOf<SE3d>(file);
  trajectory.n_normalised = file.n_normalised, trajectory.largest_norm_error = file.largest_norm_error;
  readFields(text, trajectory, options);
  if (!trajectory.hasCovariances()) return;
  // The columns of a CSV are defined as the library's own, unless the file says otherwise.
  const auto stated = statedConvention(text, trajectory.name);
  trajectory.stated_convention = stated.value_or(Convention{});
  trajectory.states_convention = stated.has_value();
  trajectory.covariance_source = trajectory.name;
}
void readTum(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options);
void readKitti(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options) {
  readAsFeatures(text, trajectory, options, "kitti");
}
void readEuroc(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options) {
  readAsFeatures(text, trajectory, options, "euroc");
}
void readCsv(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options) {
  readAsFeatures(text, trajectory, options, "csv");
}

// --- Rows of t x y z qx qy qz qw and a covariance ---------------------------------------------------------------------

/// Rows of the eight numbers of TUM and those of a layout after them. Rows without the latter are unknown if `optional`.
void readStampedRows(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options,
                     const Convention& layout, bool optional) {
  constexpr std::string_view columns[] = {"t", "tx", "ty", "tz", "qx", "qy", "qz", "qw"};
  const std::size_t with = 8 + layoutSize(layout.layout);
  LineReader reader(text);
  std::vector<std::string_view> fields;
  std::vector<double> numbers;
  while (reader.next()) {
    const std::size_t line = reader.number();
    splitFields(reader.line(), Separator::comma_or_blanks, fields);
    if (fields.size() != with && !(optional && fields.size() == 8)) {
      throwWrongWidth(fields.size(), with, fmt::format("(t tx ty tz qx qy qz qw and {})", name(layout.layout)),
                      trajectory.name, line);
    }
    appendTime(trajectory, fields[0], line);
    Eigen::Vector3d position;
    Eigen::Vector4d xyzw;
    for (int i = 0; i < 7; ++i) {
      const auto k = static_cast<std::size_t>(i + 1);
      (i < 3 ? position[i] : xyzw[i - 3]) = numberField(fields[k], columns[k], trajectory.name, line);
    }
    trajectory.poses.push_back(poseOf(position, xyzw, options.reading.norm_tolerance, trajectory, line));
    trajectory.lines.push_back(line);
    numbers.clear();
    for (std::size_t k = 8; k < fields.size(); ++k) {
      numbers.push_back(
          numberOrUnknown(fields[k], fmt::format("number {} of the covariance", k - 7), trajectory.name, line));
    }
    // A row of zeros would be a pose that is known exactly; programs write it where they know nothing.
    if (std::all_of(numbers.begin(), numbers.end(), [](double v) { return v == 0; })) {
      numbers.assign(layoutSize(layout.layout), unknown_entry);
    }
    appendCovariance(trajectory, layout, numbers, line);
  }
  trajectory.covariance_source = trajectory.name;
}

void readTum(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options) {
  if (!options.layout) return readAsFeatures(text, trajectory, options, "tum");
  readStampedRows(text, trajectory, options, {.layout = *options.layout}, false);
}

/// OpenVINS: the upper triangles of the rotation's and of the translation's covariance, in this order.
void readOpenVins(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options) {
  readStampedRows(text, trajectory, options, {.layout = CovarianceLayout::blocks12}, true);
  trajectory.fixed_order = CovarianceOrder::rotation_translation;
  const bool none = std::all_of(trajectory.covariances.begin(), trajectory.covariances.end(),
                                [](const Matrix6d& C) { return C.array().isNaN().all(); });
  if (none) trajectory.covariances.clear(), trajectory.covariance_source.clear();
}

// --- CSV files whose header names the fields of messages --------------------------------------------------------------

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

/// Reads messages from named columns: x y z, quaternion, covariance (which may be absent), times in units of
/// 10^-decimals s.
struct MessageColumns {
  std::size_t time = NamedColumns::none, decimals = 9;
  std::array<std::size_t, 3> position{};
  std::array<std::size_t, 4> xyzw{};
  std::vector<std::size_t> covariance = {};
  CovarianceLayout layout = CovarianceLayout::full36;
};
void readMessages(NamedColumns& table, const MessageColumns& columns, Trajectory& trajectory,
                  const TrajectoryOptions& options) {
  std::vector<double> numbers;
  while (table.next()) {
    if (columns.time != NamedColumns::none) {
      appendTicks(trajectory, table.field(columns.time), columns.decimals, table.line());
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
    applySentinels(numbers, columns.layout, options.unmeasured, trajectory);
    appendCovariance(trajectory, {.layout = columns.layout}, numbers, table.line());
  }
  if (!columns.covariance.empty()) trajectory.covariance_source = trajectory.name;
}

/// `rostopic echo -p` of ROS 1: integer nanoseconds, a column for each field.
void readRosCsv(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options) {
  NamedColumns table(text, trajectory.name);
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
  readMessages(table, columns, trajectory, options);
}

/// A field of an array, q[0], q0 or q_0.
std::vector<std::string> arrayNames(const char* array, int k) {
  return {fmt::format("{}[{}]", array, k), fmt::format("{}{}", array, k), fmt::format("{}_{}", array, k)};
}

/// MAVLink's ODOMETRY as CSV of its fields: microseconds, a quaternion with w first.
void readMavlinkCsv(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options) {
  NamedColumns table(text, trajectory.name);
  MessageColumns columns;
  columns.time = table.find({"time_usec", "usec"});
  columns.decimals = 6;
  for (std::size_t i = 0; i < 3; ++i) columns.position[i] = table.find({std::string(1, "xyz"[i])}, true);
  for (std::size_t i = 0; i < 4; ++i) columns.xyzw[i] = table.find(arrayNames("q", static_cast<int>(i + 1) % 4), true);
  columns.layout = CovarianceLayout::upper21;
  for (const char* array : {"pose_covariance", "covariance"}) {
    if (!columns.covariance.empty() || table.find(arrayNames(array, 0)) == NamedColumns::none) continue;
    for (int k = 0; k < 21; ++k) columns.covariance.push_back(table.find(arrayNames(array, k), true));
  }
  readMessages(table, columns, trajectory, options);
  if (trajectory.hasCovariances()) trajectory.stated_convention = conventionPreset("mavlink");
}

// --- The list of formats ----------------------------------------------------------------------------------------------

/// The beginning of a file, by which formats are told apart.
struct Look {
  std::string_view line;  ///< the first with content
  std::string_view text;
  std::size_t numbers = 0;  ///< fields of that line if all are numbers
};
struct TrajectoryFormat {
  std::string_view name;
  bool (*recognises)(const Look& look);
  void (*read)(std::string_view text, Trajectory& trajectory, const TrajectoryOptions& options);
};

bool contains(std::string_view line, std::string_view word) { return line.find(word) != std::string_view::npos; }
bool isJson(const Look& look) { return !look.line.empty() && (look.line[0] == '{' || look.line[0] == '['); }

constexpr TrajectoryFormat formats[] = {
    {"mavlink-json", [](const Look& l) { return isJson(l) && looksMavlink(l.text); }, readMavlinkJson},
    {"ros-json", [](const Look& l) { return isJson(l); }, readRosJson},
    {"ros-csv", [](const Look& l) { return contains(l.line, "field.pose."); }, readRosCsv},
    {"mavlink-csv", [](const Look& l) { return contains(l.line, "time_usec,") && contains(l.line, ",x,y,z,"); },
     readMavlinkCsv},
    {"ros-yaml",
     [](const Look& l) { return l.line == "---" || l.line == "header:" || l.line == "pose:" || l.line == "poses:"; },
     readRosYaml},
    {"openvins", [](const Look& l) { return l.numbers == 20; }, readOpenVins},
    {"tum", [](const Look& l) { return l.numbers == 8 && !contains(l.line, ","); }, readTum},
    {"kitti", [](const Look& l) { return l.numbers == 12; }, readKitti},
    {"euroc", [](const Look& l) { return contains(l.line, ",") && isNanoseconds(l.line.substr(0, l.line.find(','))); },
     readEuroc},
    // Whatever has a header; the reader of features names what it cannot read.
    {"csv", [](const Look& l) { return l.numbers == 0; }, readCsv},
};

}  // namespace

std::vector<std::string> trajectoryFormatNames() {
  std::vector<std::string> names = {"auto"};
  for (const TrajectoryFormat& format : formats) names.emplace_back(format.name);
  return names;
}

Trajectory parseTrajectory(std::string_view text, std::string name, const TrajectoryOptions& options) {
  Trajectory trajectory;
  trajectory.name = std::move(name);
  requireText(text, trajectory.name);
  LineReader reader(text);
  if (!reader.next()) throw InputError(trajectory.name, 0, "the file has no data, only blank lines and comments");
  Look look{reader.line(), text};
  std::vector<std::string_view> fields;
  splitFields(look.line, Separator::comma_or_blanks, fields);
  if (looksNumeric(fields)) look.numbers = fields.size();
  const bool automatic = options.format == "auto";
  const bool tum_with_layout = automatic && options.layout && look.numbers == 8 + layoutSize(*options.layout);
  for (const TrajectoryFormat& format : formats) {
    if (tum_with_layout ? format.name != "tum" : automatic ? !format.recognises(look) : format.name != options.format) {
      continue;
    }
    trajectory.format = std::string(format.name);
    if (options.layout && format.name != "tum") {
      throw InputError(trajectory.name, 0, fmt::format("--cov-layout for a file of the format {}", format.name),
                       "a TUM file with further columns; the other formats have a layout of their own");
    }
    format.read(text, trajectory, options);
    if (trajectory.poses.empty()) throw InputError(trajectory.name, 0, "the file has no poses", "at least one");
    return trajectory;
  }
  throw InputError(trajectory.name, reader.number(), fmt::format("{} numbers without a header", look.numbers),
                   "8 (TUM), 12 (KITTI), 20 (OpenVINS), EuRoC's nanoseconds, or a header that names the columns; "
                   "--cov-layout says what follows TUM's eight");
}

Trajectory readTrajectory(const std::string& path, const TrajectoryOptions& options) {
  const TextFile file = loadText(path);
  Trajectory trajectory = parseTrajectory(file.text, file.name, options);
  std::string side = options.covariance_file;
  std::error_code ignored;
  if (side.empty() && options.side_file && path != "-" && std::filesystem::exists(path + ".cov", ignored)) {
    side = path + ".cov";
  }
  if (side.empty()) return trajectory;
  if (trajectory.hasCovariances()) {
    if (options.covariance_file.empty()) return trajectory;
    throw InputError(trajectory.name, 0, "the file has covariances, and " + sourceName(side) + " is given",
                     "one of them");
  }
  trajectory.fixed_order.reset();
  readSideFile(side, trajectory);
  return trajectory;
}

std::vector<std::string> notesOf(const Trajectory& trajectory, const TrajectoryOptions& options) {
  std::vector<std::string> notes;
  if (trajectory.n_normalised > 0) {
    notes.push_back(fmt::format("{} rotations were normalised, off by {:.2g} at most", trajectory.n_normalised,
                                trajectory.largest_norm_error));
  }
  if (trajectory.n_unmeasured > 0) {
    notes.push_back(fmt::format("{} rows have components with a variance of {:g} or more: not measured",
                                trajectory.n_unmeasured, options.unmeasured));
  }
  return notes;
}

Convention conventionNamed(const std::string& text, std::string_view option) {
  if (const auto convention = parseConvention(text)) return *convention;
  std::vector<std::string> names;
  for (const NamedConvention& c : convention_presets) names.emplace_back(c.name);
  for (const NamedConvention& c : convention_aliases) names.emplace_back(c.name);
  const std::string near = nearestName(text.substr(0, text.find(',')), names);
  throw InputError(std::string(option), 0,
                   fmt::format("there is no convention '{}'{}", printable(text),
                               near.empty() || near == text ? "" : " (is it '" + near + "'?)"),
                   fmt::format("one of {}, and after it order=tr|rt, unit=rad|half|double|deg, "
                               "content=covariance|information|sigmas, perturbation=...",
                               joined(names, ", ")));
}

Convention conventionOf(const Trajectory& trajectory, const std::optional<Convention>& given, std::string_view option) {
  Convention convention;
  if (!given && !trajectory.stated_convention) {
    throw InputError(trajectory.name, 0,
                     fmt::format("the format {} does not say what its covariances mean", trajectory.format),
                     fmt::format("{} with a convention (docs/which_convention.md)", option));
  }
  convention = given ? *given : *trajectory.stated_convention;
  if (trajectory.fixed_order) convention.order = *trajectory.fixed_order;
  if (given && trajectory.states_convention) {
    Convention stated = *trajectory.stated_convention;
    stated.layout = convention.layout;
    if (stated != convention) {
      throw InputError(trajectory.covariance_source, 0,
                       fmt::format("its covariances are '{}', and {} says '{}'", conventionName(stated, false), option,
                                   conventionName(convention, false)),
                       "the same, or no " + std::string(option));
    }
  }
  return convention;
}

std::vector<Gaussian<SE3d>> gaussiansOf(const Trajectory& trajectory, const Convention& convention) {
  std::vector<Gaussian<SE3d>> list;
  list.reserve(trajectory.size());
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    list.push_back(fromConvention(convention, trajectory.poses[i], trajectory.covariances[i]));
  }
  return list;
}

}  // namespace liestat
