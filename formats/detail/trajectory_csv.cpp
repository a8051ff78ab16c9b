// Trajectories in formats that the reader of features knows: CSV, EuRoC, KITTI.
#include <formats/detail/feature_formats.hpp>
#include <formats/detail/rows.hpp>
#include <formats/detail/trajectory_formats.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <formats/features.hpp>
#include <formats/input_error.hpp>
#include <formats/text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <optional>

namespace liestat::detail {
void readAsFeatures(const TrajectorySource& source, Trajectory& trajectory) {
  const TrajectoryFormat& format = source.format;
  const std::string_view text = source.text;
  ReadingOptions reading = source.options.reading;
  reading.format = std::string(format.name);
  reading.without_covariances = true;
  const std::size_t rows = mostRows(text, 7);
  trajectory.poses.reserve(rows), trajectory.lines.reserve(rows);
  if (format.times != TrajectoryTimes::none) trajectory.times.reserve(rows), trajectory.time_texts.reserve(rows, 0);
  std::optional<std::size_t> time;
  std::vector<double> numbers;
  const FeatureFile whole = readFeatureRows(
      text, trajectory.name, reading,
      [&](const FeatureFile& row, const RowLayout& layout, const std::vector<std::string_view>& fields) {
        const std::size_t line = row.lines[0];
        if (row.kind != Feature::frame) {
          throw InputError(trajectory.name, line, fmt::format("the file has {}", info(row.kind).plural),
                           "poses: a translation beside each rotation");
        }
        if (!row.times.empty() && format.times != TrajectoryTimes::none) {
          if (!time) {
            time = static_cast<std::size_t>(std::find(layout.columns.begin(), layout.columns.end(), "t") -
                                            layout.columns.begin());
          }
          if (format.time_decimals > 0) {
            appendTicks(trajectory, fields[*time], format.time_decimals, line);
          } else {
            appendTime(trajectory, fields[*time], line);
          }
        }
        trajectory.poses.push_back(featuresOf<SE3d>(row)[0]);
        trajectory.lines.push_back(line);
        if (layout.covariance.empty()) return;
        numbers.clear();
        for (const std::size_t k : layout.covariance) {
          numbers.push_back(numberOrUnknown(fields[k], "a covariance", trajectory.name, line));
        }
        appendCovariance(trajectory, {.layout = *format.layout}, numbers, line);
      });
  trajectory.n_normalised = whole.n_normalised, trajectory.largest_norm_error = whole.largest_norm_error;
  if (!trajectory.hasCovariances()) return;
  // The columns of a CSV are defined as the library's own, unless the file says otherwise.
  const auto stated = statedConvention(text, trajectory.name);
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
