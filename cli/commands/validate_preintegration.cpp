#include <cli/commands/validation_command.hpp>
#include <experiments/preintegration_validation.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace liestat::cli {
using namespace experiments;
namespace {

using Row = PreintegrationRow;

const Columns<Row> columns{{"check", [](const Row& row) { return row.scene.empty() ? name(row.check) : row.scene; }},
                           {"window s", &Row::window},
                           {"noise", &Row::noise},
                           {"k", Judged::dof, ShownOn::terminal},
                           {"trials", Judged::trials, ShownOn::page},
                           {"index", Judged::index},
                           {"SE", Judged::indexError, 2},
                           {"index/k", &Row::relativeIndex, fixed(3), ShownOn::terminal},
                           {"expected", Judged::expected, ShownOn::page},
                           {"K-S p", Judged::kolmogorov, 2},
                           {"95 % covers", Judged::covered, fixed(1)},
                           {"verdict", Judged::verdict}};

/// A panel for each noise; what is checked, as a curve over the windows.
template <class Value>
Plot overWindows(const std::vector<Row>& rows, const char* name_of, const char* caption, const std::string& quantity,
                 double expected, const Value& value) {
  Plot plot{.name = name_of, .caption = caption, .columns = 3};
  std::vector<Panel>& list = plot.panels;
  for (const Row& row : rows) {
    if (row.check == PreintegrationCheck::recording) continue;
    const std::string title = fmt::format("{}, noise {:g}", quantity, row.noise);
    auto panel = std::find_if(list.begin(), list.end(), [&](const Panel& p) { return p.title == title; });
    if (panel == list.end()) {
      list.push_back({.title = title,
                      .x = {.label = "window, s", .logarithmic = true},
                      .y = {.label = quantity},
                      .references = {{.at = expected}}});
      panel = list.end() - 1;
    }
    if (panel->series.empty() || panel->series.back().name != name(row.check)) {
      panel->series.push_back({.name = name(row.check), .style = Style::linespoints});
    }
    panel->series.back().add(row.window, value(row));
  }
  return plot;
}

ValidationView viewOf(const std::vector<Row>& rows) {
  return {
      .title = "Preintegration: is the covariance true?",
      .introduction =
          "Each trial makes a motion, readings of it with noise and walking biases, and takes the squared "
          "Mahalanobis distance of the true increment under the covariance. If that is true, the distances follow "
          "a chi-square law.",
      .judgement = judgementOf(rows),
      .fields = [&rows](JsonObject& object) { object("rows", rows); },
      .head = "Squared Mahalanobis distances of true increments; noise in multiples of an ADIS16448's\n\n",
      .tables = {{.table = tablesOf(columns, rows),
                  .above = {overWindows(rows, "index", "Validation index over its expectation, 1 expected (dotted).",
                                        "index / k", 1, [](const Row& row) { return row.relativeIndex(); }),
                            overWindows(rows, "coverage", "Fraction of truths inside the 95 % region (dotted).",
                                        "covered", 0.95, [](const Row& row) { return Judged::covered(row) / 100; })},
                  .width = 110}}};
}

}  // namespace

void addValidatePreintegrationCommand(const CommandList& validate) {
  auto options = std::make_shared<ValidationOptions<PreintegrationValidation>>();
  const Command app =
      validate.add("preintegration", "Motions preintegrated from noisy inertial readings: are their covariances true?");
  declareNames(app, "--check", options->names, all_preintegration_checks,
               "motion, walk, motion_and_bias, recording: a comma list (default: all)");
  app.option("--window", options->validation.windows, "Seconds, a comma list (default 0.1,0.5,1,2)")
      .list()
      .range(0.005, 100.0);
  app.option("--noise", options->validation.noises,
             "Multiples of an ADIS16448's noise, a comma list (default 1,10,100)")
      .list()
      .range(1e-3, 1e4);
  app.flag("--full", options->run.full, "4000 trials a row, and all recordings");
  options->run.declare(app, "2000, with --full 4000");
  const auto compute = [](const auto& given, const RunProgress& progress) {
    PreintegrationValidation validation = given.validation;
    validation.checks = chosen(all_preintegration_checks, given.names);
    validation.run = given.run.size(validation.run.trials, 4000);
    validation.all_recordings = given.run.full;
    return validatePreintegration(validation, progress);
  };
  runValidation(app, options, "validate preintegration", compute, viewOf);
}

}  // namespace liestat::cli
