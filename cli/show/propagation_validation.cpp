#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/propagation_validation.hpp>

#include <fmt/format.h>

#include <cmath>
#include <optional>

namespace liestat::cli {

using namespace experiments;

namespace {

std::string propagationTables(const std::vector<PropagationRow>& rows) {
  std::string text;
  for (const Propagated feature : all_propagated) {
    std::vector<PropagationMethod> methods;
    for (const PropagationMethod& method : propagation_methods) {
      if (!rowsOf(rows, feature, method).empty()) methods.push_back(method);
    }
    if (methods.empty()) continue;
    std::vector<std::string> headers{"spread"};
    for (const PropagationMethod& method : methods) headers.push_back(label(method));
    Table index(headers), coverage(headers);
    const auto levels = rowsOf(rows, feature, methods.front());
    for (std::size_t s = 0; s < levels.size(); ++s) {
      std::vector<std::string> index_cells{number(levels[s]->experiment.spread)}, coverage_cells = index_cells;
      for (const PropagationMethod& method : methods) {
        const PropagationRow& row = *rowsOf(rows, feature, method)[s];
        const char* mark = row.passed.value_or(true) ? "" : " !";
        index_cells.push_back(std::isfinite(row.relativeIndex()) ? fmt::format("{:.3f}{}", row.relativeIndex(), mark)
                                                                 : "n/a");
        coverage_cells.push_back(fmt::format("{:.1f}", 100 * row.report.coverage[2].observed));
      }
      index.row(index_cells);
      coverage.row(coverage_cells);
    }
    Table summary({"operation", "k", "consistent up to", "promised up to"});
    for (const PropagationMethod& method : methods) {
      const std::optional<double> consistent = consistentUpTo(rows, feature, method);
      summary.row({label(method), fmt::format("{}", degreesOfFreedom(feature, method.operation)),
                   consistent ? number(*consistent) : "-", number(propagationPromise(feature, method).spread)});
    }
    text += fmt::format(
        "\n{}\n\nValidation index over k, 1 expected; spread: largest sd of the inputs, rad and m\n{}"
        "\nTruth inside the 95 % region, %\n{}"
        "\nSpread up to which the index is within {:.0f} %, and up to which it is judged\n{}",
        name(feature), index.str(), coverage.str(), 100 * consistent_deviation, summary.str());
  }
  return text;
}

/// A curve over the noise of a quantity of a method's rows.
template <class Value>
Series curve(const std::vector<const PropagationRow*>& rows, const PropagationMethod& method, const Value& value) {
  // Both orders of an operation in one colour.
  Series series{.name = label(method),
                .style = Style::linespoints,
                .colour = static_cast<std::size_t>(method.operation),
                .dashed = method.fourth_order};
  for (const PropagationRow* row : rows) {
    series.x.push_back(row->experiment.spread);
    series.y.push_back(value(*row));
  }
  return series;
}

/// The page: for each feature plots over the noise, histograms, and a table.
void drawPage(Report& report, const std::vector<PropagationRow>& rows) {
  for (const Propagated feature : all_propagated) {
    Panel index{.title = "index over k", .x = {.label = "spread", .logarithmic = true}, .y = {.label = "index / k"}};
    index.references = {{.at = 1 - consistent_deviation}, {.at = 1}, {.at = 1 + consistent_deviation}};
    Panel coverage{.title = "inside the 95 % region",
                   .x = {.label = "spread", .logarithmic = true},
                   .y = {.label = "fraction"},
                   .references = {{.at = 0.95}}};
    Panel distance{.title = "Kolmogorov-Smirnov distance",
                   .x = {.label = "spread", .logarithmic = true},
                   .y = {.label = "distance", .low = 0.0}};
    std::vector<Panel> histograms;
    std::vector<std::vector<std::string>> table;
    for (const PropagationMethod& method : propagation_methods) {
      const auto list = rowsOf(rows, feature, method);
      if (list.empty()) continue;
      index.series.push_back(curve(list, method, [](const PropagationRow& row) { return row.relativeIndex(); }));
      coverage.series.push_back(
          curve(list, method, [](const PropagationRow& row) { return row.report.coverage[2].observed; }));
      distance.series.push_back(curve(list, method, [](const PropagationRow& row) { return row.report.ks_statistic; }));
      // Where the covariance is still right, and where it is most wrong.
      const std::optional<double> consistent = consistentUpTo(rows, feature, method);
      for (const PropagationRow* row : list) {
        if (row->experiment.spread == consistent || row == list.back())
          histograms.push_back(
              histogramPanel(*row, fmt::format("{}, spread {:.3g}", label(row->method), row->experiment.spread)));
        table.push_back({label(method), number(row->experiment.spread), fmt::format("{}", row->report.trials),
                         number(row->report.index), number(row->report.index_se, 2), number(row->report.law.mean()),
                         number(row->report.ks_p_value, 2), number(100 * row->report.coverage[2].observed),
                         verdictCell(row->passed)});
      }
    }
    if (table.empty()) continue;
    report.section(name(feature));
    report.plot({.name = name(feature) + "_over_noise",
                 .caption = fmt::format("{}: index, coverage and K-S distance over the noise; dotted, what is expected "
                                        "and {:.0f} % from it.",
                                        name(feature), 100 * consistent_deviation),
                 .panels = {index, coverage, distance},
                 .columns = 3});
    report.plot({.name = name(feature) + "_histograms",
                 .caption = fmt::format("{}: squared distances at the largest spread with a consistent index, and at "
                                        "the largest of all.",
                                        name(feature)),
                 .panels = histograms,
                 .columns = 4});
    report.table({"operation", "spread", "trials", "index", "SE", "expected", "K-S p", "95 % covers", "verdict"},
                 table);
  }
}

}  // namespace

ValidationView viewOf(const std::vector<PropagationRow>& rows) {
  return {.title = "Propagation of covariances: up to which noise is it right?",
          .introduction =
              "Each trial draws features with their noise, composes, inverts or compares them or moves a point, and "
              "takes the squared Mahalanobis distance of the true result under the propagated covariance. If that is "
              "true these distances follow a chi-square law, and their mean, the validation index, is the number of "
              "degrees of freedom k. A larger index says that the covariance is too small. The spread is the largest "
              "standard deviation of the inputs, in rad and m.",
          .judgement = judgementOf(rows),
          .fields = [&rows](JsonObject& object) { object("rows", rows); },
          .head = propagationTables(rows),
          .page = [&rows](Report& report) { drawPage(report, rows); }};
}

}  // namespace liestat::cli
