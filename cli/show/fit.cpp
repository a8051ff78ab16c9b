#include <cli/show/fit.hpp>

#include <cli/show/units.hpp>
#include <formats/output_file.hpp>
#include <report/page.hpp>
#include <report/table.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr double reach_of_95_percent = 1.959963984540054;

TableRows parameterRows(const FitSummary& fit) {
  TableRows table{{"parameter", "value", "sd", "unit"}};
  for (std::size_t i = 0; i < fit.names.size(); ++i) {
    const bool angle = fit.names[i] == "angle";
    const double unit = angle ? degrees : 1;
    table.rows.push_back({fit.names[i], number(unit * fit.parameter[static_cast<Eigen::Index>(i)], 7),
                          number(unit * fit.deviation(i), 2), angle ? "deg" : ""});
  }
  return table;
}

std::string summary(const FitOutput& output) {
  const FitSummary& fit = output.fit;
  std::string text = fmt::format("{}: {} {} of {}\n", name(fit.model), fit.points,
                                 coordinateNames(fit.model).size() == 4 ? "matches" : "points", output.file);
  text += fmt::format("sigma {} ({})", number(fit.sigma),
                      fit.stated ? "stated" : "of the residuals: the covariance takes them to be noise alone");
  if (fit.birge_factor > 1) text += fmt::format(", variances times {}", number(fit.birge_factor, 3));
  if (fit.widening > 1) {
    text += fmt::format("\nthe model is curved on the scale of the noise: variances times {}", number(fit.widening, 3));
  }
  return text + "\n";
}

/// The curve itself and the band that holds it at each place with 95 %, where sd is known: lines where the distance is
/// 0, and ±1.96 times its deviation.
Plot curvePlot(const FitOutput& output) {
  constexpr std::size_t cells = 240;
  const auto x = output.points.col(0), y = output.points.col(1);
  const double size = std::max({x.maxCoeff() - x.minCoeff(), y.maxCoeff() - y.minCoeff(), output.fit.sigma});
  const double margin = 0.1 * size + 4 * output.fit.sigma;
  Grid distance, deviations;
  for (std::size_t k = 0; k <= cells; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(cells);
    distance.x.push_back(x.minCoeff() - margin + share * (x.maxCoeff() - x.minCoeff() + 2 * margin));
    distance.y.push_back(y.minCoeff() - margin + share * (y.maxCoeff() - y.minCoeff() + 2 * margin));
  }
  deviations.x = distance.x, deviations.y = distance.y;
  for (const double to : distance.y) {
    for (const double from : distance.x) {
      const CurveDistance d = output.fit.distanceOf({from, to});
      distance.value.push_back(d.value);
      deviations.value.push_back(d.value / d.deviation);
    }
  }
  Series points{.name = "points", .style = Style::points, .colour = 1};
  for (Eigen::Index i = 0; i < x.size(); ++i) points.add(x[i], y[i]);
  Series band = contours("95 % of the curve at each place", deviations, {-reach_of_95_percent, reach_of_95_percent});
  Series curve = contours(name(output.fit.model), distance, {0});
  // Contours take the colours of their levels; these two are lines of their own.
  for (Series* line : {&band, &curve}) line->style = Style::lines, line->value.clear();
  band.colour = 5, band.dashed = true, curve.colour = 0;
  Panel panel{.x = {"x"}, .y = {"y"}, .equal_aspect = true};
  panel.add({band, curve, points});
  return {.name = "curve",
          .caption =
              "The points and the curve. Between the dashed lines the curve runs with a probability of 95 % at each "
              "place, by its covariance.",
          .panels = {panel}};
}

Plot distancePlot(const FitSummary& fit) {
  Series series{.style = Style::points, .colour = 0};
  for (std::size_t i = 0; i < fit.distances.size(); ++i) series.add(static_cast<double>(i + 1), fit.distances[i]);
  Panel panel{{}, {"row"}, {.label = "distance from the model", .low = 0.0}, {}, {series}};
  panel.references = {{ReferenceLine::Direction::horizontal, 3 * fit.sigma}};
  return {.name = "distances",
          .caption =
              "Distances of the points from the model, in the order of the file. The dotted line is at three "
              "sigma.",
          .panels = {panel}};
}

/// The points that are farthest from the model, for the page.
TableRows farthest(const FitSummary& fit) {
  constexpr std::size_t shown = 10;
  std::vector<std::size_t> order(fit.distances.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](auto i, auto k) { return fit.distances[i] > fit.distances[k]; });
  order.resize(std::min(shown, order.size()));
  return tableOf<std::size_t>({{"row", [](std::size_t i) { return i + 1; }},
                               {"distance", [&](std::size_t i) { return fit.distances[i]; }, 3},
                               {"in sigma", [&](std::size_t i) { return fit.distances[i] / fit.sigma; }, 3}},
                              order);
}

TableRows covarianceRows(const FitSummary& fit) {
  TableRows table{{""}, {}};
  for (std::size_t i = 0; i < fit.names.size(); ++i) {
    table.headers.push_back(fit.names[i]);
    std::vector<std::string>& row = table.rows.emplace_back(1, fit.names[i]);
    for (std::size_t k = 0; k < fit.names.size(); ++k) {
      row.push_back(number(fit.covariance(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(k)), 3));
    }
  }
  return table;
}

TableRows lawRows(const LawFit& fit) {
  TableRows table{{"parameter", "value", "sd"}};
  for (std::size_t i = 0; i < fit.names.size() && fit.law.kappa.size() > 0; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    table.rows.push_back({fit.names[i], number(fit.law.kappa[k], 7), number(fit.kappaDeviation(k), 2)});
  }
  return table;
}

TableRows lawTests(const LawFit& fit) {
  TableRows table{{"test", "chi2", "dof", "p"}};
  const auto add = [&](const char* what, const LawTest& test) {
    if (!std::isnan(test.p)) {
      table.rows.push_back({what, number(test.statistic), cell(test.degrees_of_freedom), number(test.p, 2)});
    }
  };
  add("goodness of fit", fit.goodness), add("uniform", fit.uniformity), add("rotational symmetry", fit.symmetry);
  return table;
}

std::string lawSummary(const LawOutput& output) {
  const LawFit& fit = output.fit;
  std::string text = fmt::format("{}: {} features of {}\n", name(fit.law.model), fit.n, output.file);
  if (fit.confidence_angles.empty()) return text;
  std::vector<std::string> place, angles;
  for (const double x : fit.law.location) place.push_back(number(x, 7));
  for (const double angle : fit.confidence_angles) angles.push_back(number(degrees * angle, 4));
  text += fmt::format("{} {}\n", fit.girdle ? "pole of the girdle" : "location", fmt::join(place, " "));
  text += fmt::format("95 % region of the location, half axes: {} deg\n", fmt::join(angles, ", "));
  return text;
}

}  // namespace

std::string formatLaw(const LawOutput& output) {
  std::string text = lawSummary(output) + output.fit.verdict().text + "\n";
  if (output.fit.kappa_covariance.size() == 0) return text;
  return text + "\n" + Table(lawRows(output.fit)).str() + "\n" + Table(lawTests(output.fit)).str();
}

void writeLawReport(const std::string& directory, const std::string& command_line, const LawOutput& output) {
  Report report(directory, fmt::format("A fit of the law {}", name(output.fit.law.model)));
  report.verdict(output.fit.verdict());
  report.code(command_line);
  report.paragraph(lawSummary(output));
  report.table(lawRows(output.fit), "Concentrations; angles in rad.");
  report.table(lawTests(output.fit), "The p of the goodness of fit is Bonferroni's of several moments.");
  printLines("\n" + report.write() + "\n");
}

std::string formatFit(const FitOutput& output) {
  return summary(output) + output.fit.verdict().text + "\n\n" + Table(parameterRows(output.fit)).str();
}

void writeFitReport(const std::string& directory, const std::string& command_line, const FitOutput& output) {
  const FitSummary& fit = output.fit;
  Report report(directory, fmt::format("A fit of a {}", name(fit.model)));
  report.verdict(fit.verdict());
  report.code(command_line);
  report.paragraph(summary(output));
  report.table(parameterRows(fit));
  if (output.points.cols() == 2 && output.points.rows() > 0) report.plot(curvePlot(output));
  if (!fit.distances.empty()) {
    report.section("Distances");
    report.plot(distancePlot(fit));
    report.table(farthest(fit), "The points that are farthest from the model; rows are counted below the header.");
  }
  report.section("Covariance");
  report.table(covarianceRows(fit), "First order, angles in rad. Singular where a constraint ties the parameters.");
  printLines("\n" + report.write() + "\n");
}

}  // namespace liestat::cli
