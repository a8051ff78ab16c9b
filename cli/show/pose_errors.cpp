#include <cli/show/pose_errors.hpp>

#include <report/table.hpp>
#include <cli/show/units.hpp>

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstddef>

namespace liestat::cli {
std::pair<std::string, double> coordinateOfError(int k) {
  constexpr std::array labels{"x, m", "y, m", "z, m", "rotation x, deg", "rotation y, deg", "rotation z, deg"};
  return {labels[static_cast<std::size_t>(k)], k < 3 ? 1 : degrees};
}

std::vector<Panel> errorPanels(const std::vector<PoseError>& errors, const TimesOfPoses& times) {
  std::vector<Panel> panels;
  for (int k = 0; k < 6; ++k) {
    Series band{.name = "3 sd", .style = Style::filled_curve}, error{.name = "error"};
    const auto [label, unit] = coordinateOfError(k);
    for (std::size_t i = 0; i < errors.size(); ++i) {
      const double sigma = 3 * unit * std::sqrt(errors[i].covariance(k, k));
      if (!std::isfinite(sigma)) continue;
      band.addBand(times.values[i], -sigma, sigma);
      error.add(times.values[i], unit * errors[i].error[k]);
    }
    panels.push_back({.x = {.label = times.label()}, .y = {.label = label}, .series = {band, error}});
  }
  return panels;
}

Panel neesPanel(const TimesOfPoses& times, int dof) {
  return {.x = {.label = times.label()},
          .y = {.label = "NEES of a pose", .logarithmic = true},
          .references = {{ReferenceLine::Direction::horizontal, neesInterval(dof).low},
                         {ReferenceLine::Direction::horizontal, neesInterval(dof).high}}};
}

Series neesSeries(std::string name, const std::vector<PoseError>& errors, const TimesOfPoses& times) {
  Series points{.name = std::move(name), .style = Style::points};
  for (std::size_t i = 0; i < errors.size(); ++i) {
    points.add(times.values[i], errors[i].nees);
  }
  return points;
}

std::string neesBounds(int dof) {
  return fmt::format("95 % of them lie between the dotted lines, {} and {}, if the covariances are right.",
                     number(neesInterval(dof).low, 3), number(neesInterval(dof).high, 3));
}

}  // namespace liestat::cli
