#include <cli/commands/validation_command.hpp>
#include <experiments/propagation_validation.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <cmath>
#include <memory>
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
        "\n{}\n\nValidation index over k, 1 expected; spread: largest sd of the inputs, rad and m\n{}\nTruth inside "
        "the 95 % region, %\n{}\nSpread up to which the index is within {:.0f} %, and up to which it is judged\n{}",
        name(feature), index.str(), coverage.str(), 100 * consistent_deviation, summary.str());
  }
  return text;
}

const Columns<PropagationRow> columns{{"operation", [](const PropagationRow& row) { return label(row.method); }},
                                      {"spread", [](const PropagationRow& row) { return row.experiment.spread; }},
                                      {"trials", Judged::trials},
                                      {"index", Judged::index},
                                      {"SE", Judged::indexError, 2},
                                      {"expected", Judged::expected},
                                      {"K-S p", Judged::kolmogorov, 2},
                                      {"95 % covers", Judged::covered},
                                      {"verdict", Judged::verdict}};

/// A curve over the noise of a quantity of a method's rows.
template <class Value>
Series curve(const std::vector<const PropagationRow*>& rows, const PropagationMethod& method, const Value& value) {
  // Both orders of an operation in one colour.
  Series series{.name = label(method),
                .style = Style::linespoints,
                .colour = static_cast<std::size_t>(method.operation),
                .dashed = method.fourth_order};
  for (const PropagationRow* row : rows) series.add(row->experiment.spread, value(*row));
  return series;
}

/// The page: for each feature plots over the noise, histograms, and a table.
void drawPage(Report& report, const std::vector<PropagationRow>& rows) {
  for (const Propagated feature : all_propagated) {
    const Axis spread{.label = "spread", .logarithmic = true};
    Panel index{.title = "index over k", .x = spread, .y = {.label = "index / k"}};
    index.references = {{.at = 1 - consistent_deviation}, {.at = 1}, {.at = 1 + consistent_deviation}};
    Panel coverage{
        .title = "inside the 95 % region", .x = spread, .y = {.label = "fraction"}, .references = {{.at = 0.95}}};
    Panel distance{.title = "Kolmogorov-Smirnov distance", .x = spread, .y = {.label = "distance", .low = 0.0}};
    std::vector<Panel> histograms;
    std::vector<std::reference_wrapper<const PropagationRow>> shown;
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
        shown.emplace_back(*row);
      }
    }
    if (shown.empty()) continue;
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
    report.table(tableOf(columns, shown));
  }
}

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

}  // namespace

void addValidatePropagationCommand(const CommandList& validate) {
  auto options = std::make_shared<ValidationOptions<PropagationValidation>>();
  const Command app = validate.add(
      "propagation", "Composition, inverse and action of uncertain features: up to which noise is first order right?");
  declareNames(app, "--feature", options->names, all_propagated,
               "rotation, pose, similarity: a comma list (default: all)");
  declareNames(app, "--operation", options->more_names, all_operations,
               "compose, inverse, between, act, chain (of ten factors): a comma list (default: all)");
  app.option("--spread", options->validation.spreads,
             "Largest standard deviations, rad and m, a comma list (default 0.01,0.03,0.1,0.2,0.3,0.5,1)")
      .list()
      .range(1e-6, 10.0);
  options->run.declare(app, "20000");
  const auto compute = [](const auto& given, const RunProgress& progress) {
    PropagationValidation validation = given.validation;
    validation.features = chosen(all_propagated, given.names);
    validation.operations = chosen(all_operations, given.more_names);
    validation.run = given.run.size(validation.run.trials);
    return validatePropagation(validation, progress);
  };
  runValidation(app, options, "validate propagation", compute, viewOf);
}

}  // namespace liestat::cli
