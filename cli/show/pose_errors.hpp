// The panels that show the errors of poses, for the pages of `liestat evaluate` and `liestat doctor`.
#pragma once

#include <report/page.hpp>
#include <fusion/trajectories_types.hpp>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {

/// The times of poses from a start, s, or the numbers of their rows.
struct TimesOfPoses {
  std::vector<double> values;
  bool by_time = true;

  /// Times on a clock; the start is the first of them unless it is given.
  TimesOfPoses(std::vector<double> times, bool are_times, std::optional<double> start = {})
      : values(std::move(times)), by_time(are_times) {
    if (!by_time || values.empty()) return;
    const double first = start.value_or(values.front());
    for (double& t : values) t -= first;
  }
  const char* label() const { return by_time ? "time from the start, s" : "row"; }
};

/// The name of a coordinate of an error, with its unit, and how many of the unit make a metre or radian.
std::pair<std::string, double> coordinateOfError(int k);

/// Six panels: each coordinate of the errors over the times, with the band of three standard deviations. Poses without
/// a covariance are left out.
std::vector<Panel> errorPanels(const std::vector<PoseError>& errors, const TimesOfPoses& times);

/// NEES of each pose over the times, with the lines between which 95 % lie if the covariances are right.
Panel neesPanel(const TimesOfPoses& times, int dof);
/// The series for it.
Series neesSeries(std::string name, const std::vector<PoseError>& errors, const TimesOfPoses& times);
/// The sentence about the lines.
std::string neesBounds(int dof);

}  // namespace liestat::cli
