// TUM's rows of t x y z qx qy qz qw, and those of OpenVINS, which have a covariance after them.
#include <formats/detail/trajectory_formats.hpp>
#include <formats/detail/trajectory_rows.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/text.hpp>
#include <stats/convention_layouts.hpp>
#include <stats/convention_presets.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace liestat::detail {

namespace {

/// Rows of the eight numbers of TUM and those of a layout after them. Rows without the latter are unknown if `optional`.
void readStampedRows(const TrajectorySource& source, Trajectory& trajectory, CovarianceLayout layout, bool optional) {
  constexpr std::string_view columns[] = {"t", "tx", "ty", "tz", "qx", "qy", "qz", "qw"};
  const std::size_t with = 8 + layoutSize(layout);
  LineReader reader(source.text);
  std::vector<std::string_view> fields;
  std::vector<double> numbers;
  while (reader.next()) {
    const std::size_t line = reader.number();
    splitFields(reader.line(), Separator::comma_or_blanks, fields);
    if (fields.size() != with && !(optional && fields.size() == 8)) {
      throwWrongWidth(fields.size(), with, fmt::format("(t tx ty tz qx qy qz qw and {})", name(layout)),
                      trajectory.name, line);
    }
    appendTime(trajectory, fields[0], line);
    Eigen::Vector3d position;
    Eigen::Vector4d xyzw;
    for (int i = 0; i < 7; ++i) {
      const auto k = static_cast<std::size_t>(i) + 1;
      (i < 3 ? position[i] : xyzw[i - 3]) = numberField(fields[k], columns[k], trajectory.name, line);
    }
    trajectory.poses.push_back(poseOf(position, xyzw, source.options.reading.norm_tolerance, trajectory, line));
    trajectory.lines.push_back(line);
    numbers.clear();
    for (std::size_t k = 8; k < fields.size(); ++k) {
      numbers.push_back(
          numberOrUnknown(fields[k], fmt::format("number {} of the covariance", k - 7), trajectory.name, line));
    }
    // A row of zeros would be a pose that is known exactly; programs write it where they know nothing.
    if (std::all_of(numbers.begin(), numbers.end(), [](double v) { return v == 0; })) {
      numbers.assign(layoutSize(layout), unknown_entry);
    }
    appendCovariance(trajectory, {.layout = layout}, numbers, line);
  }
  trajectory.covariance_source = trajectory.name;
}

void writeStamped(TrajectorySink& sink, std::size_t i) {
  sink.text() += sink.seconds(i);
  sink.numbers(sink.position(i), ' ');
  sink.numbers(sink.xyzw(i), ' ');
}

}  // namespace

void readTum(const TrajectorySource& source, Trajectory& trajectory) {
  if (!source.options.layout) return readAsFeatures(source, trajectory);
  readStampedRows(source, trajectory, *source.options.layout, false);
}

void writeTum(TrajectorySink& sink) {
  for (std::size_t i = 0; i < sink.size(); ++i) writeStamped(sink, i), sink.text() += '\n';
}

void readOpenVins(const TrajectorySource& source, Trajectory& trajectory) {
  readStampedRows(source, trajectory, *source.format.layout, true);
  const bool none = std::all_of(trajectory.covariances.begin(), trajectory.covariances.end(),
                                [](const Matrix6d& C) { return C.array().isNaN().all(); });
  if (none) trajectory.covariances.clear(), trajectory.covariance_source.clear();
}

void writeOpenVins(TrajectorySink& sink) {
  if (sink.hasCovariances()) {
    sink.text() += "# timestamp(s) tx ty tz qx qy qz qw Pr11 Pr12 Pr13 Pr22 Pr23 Pr33 Pt11 Pt12 Pt13 Pt22 Pt23 Pt33\n";
  }
  for (std::size_t i = 0; i < sink.size(); ++i) {
    writeStamped(sink, i);
    if (sink.hasCovariances()) sink.numbers(sink.covariance(i), ' ');
    sink.text() += '\n';
  }
}

}  // namespace liestat::detail
