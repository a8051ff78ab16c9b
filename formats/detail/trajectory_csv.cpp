// Trajectories in formats that the reader of features knows: CSV, EuRoC, KITTI.
#include <formats/detail/trajectory_formats.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <formats/features.hpp>
#include <formats/input_error.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

namespace liestat::detail {
namespace {

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

/// Reads the fields of the rows whose poses have been read: those of a time, and, where a header names the columns, of a
/// covariance.
void readFields(const TrajectorySource& source, Trajectory& trajectory) {
  const auto& [text, format, options] = source;
  const bool csv = format.covariances == CovariancePlace::header;
  const std::vector<std::string> columns = csv ? csvColumns(text, options) : std::vector<std::string>();
  const auto place = [&](const std::string& column) {
    return static_cast<std::size_t>(std::find(columns.begin(), columns.end(), column) - columns.begin());
  };
  const std::size_t time = csv ? place("t") : 0;
  const bool has_time = format.times != TrajectoryTimes::none && (!csv || time < columns.size());
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
    if (has_time && format.time_decimals > 0) {
      appendTicks(trajectory, fields[time], format.time_decimals, line);
    } else if (has_time) {
      appendTime(trajectory, fields[time], line);
    }
    if (covariance.empty()) continue;
    numbers.clear();
    for (std::size_t k = 0; k < covariance.size(); ++k) {
      numbers.push_back(numberOrUnknown(fields[covariance[k]], columns[covariance[k]], trajectory.name, line));
    }
    appendCovariance(trajectory, {.layout = *format.layout}, numbers, line);
  }
}

}  // namespace

void readAsFeatures(const TrajectorySource& source, Trajectory& trajectory) {
  ReadingOptions reading = source.options.reading;
  reading.format = std::string(source.format.name);
  reading.without_covariances = true;
  const FeatureFile file = readFeatures(source.text, trajectory.name, reading);
  if (file.kind != Feature::frame) {
    throw InputError(trajectory.name, file.lines.front(), fmt::format("the file has {}", info(file.kind).plural),
                     "poses: a translation beside each rotation");
  }
  trajectory.lines = file.lines;
  trajectory.poses = featuresOf<SE3d>(file);
  trajectory.n_normalised = file.n_normalised, trajectory.largest_norm_error = file.largest_norm_error;
  readFields(source, trajectory);
  if (!trajectory.hasCovariances()) return;
  // The columns of a CSV are defined as the library's own, unless the file says otherwise.
  const auto stated = statedConvention(source.text, trajectory.name);
  trajectory.stated_convention = stated.value_or(Convention{});
  trajectory.states_convention = stated.has_value();
  trajectory.covariance_source = trajectory.name;
}

void readKitti(const TrajectorySource& source, Trajectory& trajectory) { readAsFeatures(source, trajectory); }
void readEuroc(const TrajectorySource& source, Trajectory& trajectory) { readAsFeatures(source, trajectory); }
void readCsv(const TrajectorySource& source, Trajectory& trajectory) { readAsFeatures(source, trajectory); }

void writeKitti(TrajectorySink& sink) {
  for (std::size_t i = 0; i < sink.size(); ++i) {
    const Eigen::Matrix<double, 3, 4> T = sink.pose(i).matrix3x4();
    for (int k = 0; k < 12; ++k) {
      if (k > 0) sink.text() += ' ';
      sink.number(T(k / 4, k % 4));
    }
    sink.text() += '\n';
  }
}

void writeEuroc(TrajectorySink& sink) {
  sink.text() += "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w [],q_x [],q_y [],q_z []\n";
  for (std::size_t i = 0; i < sink.size(); ++i) {
    sink.text() += sink.ticks(i);
    sink.numbers(sink.position(i), ',');
    sink.numbers(sink.wxyz(i), ',');
    sink.text() += '\n';
  }
}

void writeCsv(TrajectorySink& sink) {
  const Convention own{.layout = CovarianceLayout::upper21};
  if (sink.hasCovariances() && sink.convention() != own) sink.text() += conventionHeader(sink.convention());
  sink.text() += sink.hasTimes() ? "t,tx,ty,tz,qx,qy,qz,qw" : "tx,ty,tz,qx,qy,qz,qw";
  for (int i = 0; i < 6 && sink.hasCovariances(); ++i) {
    for (int j = i; j < 6; ++j) fmt::format_to(std::back_inserter(sink.text()), ",cov_{}{}", i, j);
  }
  sink.text() += '\n';
  for (std::size_t i = 0; i < sink.size(); ++i) {
    if (sink.hasTimes()) sink.text() += sink.seconds(i) + ",";
    sink.number(sink.position(i)[0]);
    sink.numbers(sink.position(i).tail<2>(), ',');
    sink.numbers(sink.xyzw(i), ',');
    if (sink.hasCovariances()) sink.numbers(sink.covariance(i), ',');
    sink.text() += '\n';
  }
}

}  // namespace liestat::detail
