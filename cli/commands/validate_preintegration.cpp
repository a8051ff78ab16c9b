#include <cli/commands/commands.hpp>
#include <cli/show/page.hpp>
#include <cli/show/table.hpp>
#include <experiments/preintegration_validation.hpp>
#include <cli/commands/validation_command.hpp>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  PreintegrationValidation validation;
  std::vector<std::string> checks;
  std::vector<double> windows, noises;
  ValidationOutput output;
};

JsonObject toJson(const PreintegrationRow& row) {
  JsonObject o;
  o.set("check", name(row.check)).set("window", row.window).set("noise", row.noise);
  o.set("in_domain", row.passed.has_value());
  setStatistics(o, row.report);
  o.set("failures", row.report.failures).set("passed", row.passed);
  return o;
}

void writeReport(const std::string& directory, const std::string& command_line,
                 const std::vector<PreintegrationRow>& rows) {
  Report report(directory, "Preintegration: is the covariance true?");
  report.paragraph(
      "Each trial makes a motion, readings of it with noise and walking biases, and takes the squared Mahalanobis "
      "distance of the true increment under the covariance. If that is true, the distances follow a chi-square law.");
  report.code(command_line);
  // A panel for each noise; what is checked, as a curve over the windows.
  const auto panels = [&](const std::string& quantity, double expected, const auto& value) {
    std::vector<Panel> list;
    for (const PreintegrationRow& row : rows) {
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
      panel->series.back().x.push_back(row.window);
      panel->series.back().y.push_back(value(row));
    }
    return list;
  };
  report.plot({.name = "index",
               .caption = "Validation index over its expectation, 1 expected (dotted).",
               .panels = panels("index / k", 1,
                                [](const PreintegrationRow& row) { return row.report.index / row.report.law.mean(); }),
               .columns = 3});
  report.plot(
      {.name = "coverage",
       .caption = "Fraction of truths inside the 95 % region (dotted).",
       .panels = panels("covered", 0.95, [](const PreintegrationRow& row) { return row.report.coverage[2].observed; }),
       .columns = 3});
  std::vector<std::vector<std::string>> table;
  for (const PreintegrationRow& row : rows) {
    table.push_back({name(row.check), number(row.window), number(row.noise), fmt::format("{}", row.report.trials),
                     number(row.report.index), number(row.report.index_se, 2), number(row.report.law.mean()),
                     number(row.report.ks_p_value, 2), number(100 * row.report.coverage[2].observed),
                     !row.passed   ? ""
                     : *row.passed ? "pass"
                                   : "FAIL"});
  }
  report.table({"check", "window s", "noise", "trials", "index", "SE", "expected", "K-S p", "95 % covers", "verdict"},
               table);
  report.write();
}

int runCommand(const Options& options, const Invocation& invocation) {
  PreintegrationValidation validation = options.validation;
  validation.checks = chosen(all_preintegration_checks, options.checks);
  if (!options.windows.empty()) validation.windows = options.windows;
  if (!options.noises.empty()) validation.noises = options.noises;
  const std::vector<PreintegrationRow> rows = withProgressBar(
      "validate preintegration", [&](const auto& progress) { return validatePreintegration(validation, progress); });
  return publish(options.output, invocation, validation.seed, preintegration_false_alarm, rows,
                 formatPreintegrationTable, toJson, writeReport);
}

}  // namespace

void addValidatePreintegrationCommand(CLI::App& validate, Invocation& invocation) {
  auto options = std::make_shared<Options>();
  CLI::App* app = validate.add_subcommand(
      "preintegration", "Motions preintegrated from noisy inertial readings: are their covariances true?");
  app->add_option("--check", options->checks, "motion, walk, motion_and_bias: a comma list (default: all)")
      ->delimiter(',')
      ->check(CLI::IsMember(names(all_preintegration_checks)));
  app->add_option("--window", options->windows, "Seconds, a comma list (default 0.1,0.5,1,2)")
      ->delimiter(',')
      ->check(CLI::Range(0.005, 100.0));
  app->add_option("--noise", options->noises, "Multiples of an ADIS16448's noise, a comma list (default 1,10,100)")
      ->delimiter(',')
      ->check(CLI::Range(1e-3, 1e4));
  addRunOptions(*app, "2000", options->validation.trials, options->validation.seed, options->validation.threads,
                options->output);
  app->callback(
      [options, &invocation] { invocation.run = [options, &invocation] { return runCommand(*options, invocation); }; });
}

}  // namespace liestat::cli
