#include <cli/commands.hpp>
#include <cli/validate_propagation.hpp>
#include <cli/validation_command.hpp>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <cstdio>
#include <memory>

namespace liestat::cli {
namespace {

struct Options {
  PropagationValidation validation;
  std::vector<std::string> features, operations;
  std::vector<double> spreads;
  std::string json, report;
};

JsonObject toJson(const PropagationRow& row) {
  const ValidationReport& r = row.report;
  JsonObject o;
  o.set("feature", name(row.experiment.feature)).set("operation", name(row.method.operation));
  o.set("order", row.method.fourth_order ? 4 : 1).set("in_domain", row.promise.has_value());
  o.set("spread", row.experiment.spread);
  setStatistics(o, r);
  o.set("tail", row.tail).set("failures", r.failures).set("passed", row.passed);
  return o;
}

int runCommand(const Options& options, const Invocation& invocation) {
  PropagationValidation validation = options.validation;
  validation.features = chosen(all_propagated, options.features);
  validation.operations = chosen(all_operations, options.operations);
  if (!options.spreads.empty()) validation.spreads = options.spreads;

  const std::vector<PropagationRow> rows = withProgressBar(
      "validate propagation", [&](const auto& progress) { return validatePropagation(validation, progress); });
  std::fputs(formatPropagationTables(rows).c_str(), stdout);
  writeRows(options.json, invocation, validation.seed, propagation_false_alarm, rows, toJson);
  if (!options.report.empty()) writePropagationReport(options.report, invocation.command_line, rows);
  return exitCodeOf(rows);
}

}  // namespace

void addValidatePropagationCommand(CLI::App& validate, Invocation& invocation) {
  auto options = std::make_shared<Options>();
  CLI::App* app = validate.add_subcommand(
      "propagation", "Composition, inverse and action of uncertain features: up to which noise is first order right?");
  app->add_option("--feature", options->features, "rotation, pose, similarity: a comma list (default: all)")
      ->delimiter(',')
      ->check(CLI::IsMember(names(all_propagated)));
  app->add_option("--operation", options->operations,
                  "compose, inverse, between, act, chain (of ten factors): a comma list (default: all)")
      ->delimiter(',')
      ->check(CLI::IsMember(names(all_operations)));
  app->add_option("--spread", options->spreads,
                  "Largest standard deviations, rad and m, a comma list (default 0.01,0.03,0.1,0.2,0.3,0.5,1)")
      ->delimiter(',')
      ->check(CLI::Range(1e-6, 10.0));
  app->add_option("--trials", options->validation.trials, "Trials a row (default 20000)")
      ->check(CLI::Range(std::size_t{1}, std::size_t{100000000}));
  app->add_option("--seed", options->validation.seed,
                  "Seed; the same seed gives the same bits on any number of threads");
  app->add_option("--threads", options->validation.threads, "Threads (default: all)")->check(CLI::Range(0, 4096));
  app->add_option("--json", options->json, "Write the rows to a JSON file ('-': standard output)");
  app->add_option("--report", options->report, "Write a page with plots into this directory");
  app->callback(
      [options, &invocation] { invocation.run = [options, &invocation] { return runCommand(*options, invocation); }; });
}

}  // namespace liestat::cli
