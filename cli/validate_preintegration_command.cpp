#include <cli/commands.hpp>
#include <cli/report.hpp>
#include <cli/table.hpp>
#include <cli/validate_preintegration.hpp>
#include <cli/validation_command.hpp>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace liestat::cli {
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
  Panel index{.title = "index over k", .x = {.label = "window, s", .logarithmic = true}, .y = {.label = "index / k"}};
  Panel coverage{.title = "inside the 95 % region",
                 .x = {.label = "window, s", .logarithmic = true},
                 .y = {.label = "fraction"},
                 .references = {{.at = 0.95}}};
  index.references = {{.at = 1}};
  std::vector<std::vector<std::string>> table;
  const auto label = [](const PreintegrationRow& row) {
    return fmt::format("{}, noise {:g}", name(row.check), row.noise);
  };
  for (const PreintegrationRow& head : rows) {
    const auto& drawn = index.series;
    if (std::any_of(drawn.begin(), drawn.end(), [&](const Series& s) { return s.name == label(head); })) continue;
    Series indices{.name = label(head), .style = Style::linespoints, .colour = index.series.size()}, covers = indices;
    for (const PreintegrationRow& row : rows) {
      if (label(row) != label(head)) continue;
      indices.x.push_back(row.window), covers.x.push_back(row.window);
      indices.y.push_back(row.report.index / row.report.law.mean());
      covers.y.push_back(row.report.coverage[2].observed);
    }
    index.series.push_back(indices);
    coverage.series.push_back(covers);
  }
  for (const PreintegrationRow& row : rows) {
    table.push_back({label(row), number(row.window), fmt::format("{}", row.report.trials), number(row.report.index),
                     number(row.report.index_se, 2), number(row.report.ks_p_value, 2),
                     number(100 * row.report.coverage[2].observed),
                     !row.passed   ? ""
                     : *row.passed ? "pass"
                                   : "FAIL"});
  }
  report.plot({.name = "over_windows",
               .caption = "Index over its expectation, and coverage, over the length of the window.",
               .panels = {index, coverage},
               .columns = 2});
  report.table({"check", "window s", "trials", "index", "SE", "K-S p", "95 % covers", "verdict"}, table);
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
