#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <cli/show/table1.hpp>
#include <cli/show/two_solutions.hpp>
#include <cli/show/vi_init_validation.hpp>

#include <algorithm>
#include <memory>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  std::vector<std::string> checks;
  std::vector<double> windows;
  double noise = 1;
  std::size_t trials = 0;
  std::uint64_t seed = 1;
  int threads = 0;
  bool full = false, table1 = false;
  std::string scene;
  ValidationOutput output;
};

int runTable1(const Options& options, const Invocation& invocation) {
  const std::size_t scenes = options.trials != 0 ? options.trials : options.full ? 1000 : 100;
  const std::vector<Table1Row> rows = runTrials("validate vi-init --table1", [&](const auto& progress) {
    return recogniseTable1(scenes, options.seed, options.threads, progress);
  });
  return publish(
      options.output, invocation, options.seed, run_false_alarm, rows, formatTable1,
      [](const Table1Row& row) { return toJson(row); }, writeTable1Report);
}

int runScene(const Options& options, const Invocation& invocation) {
  if (options.output.report.empty()) {
    throw OptionError("--scene", "draws into a directory and none is named", "--report DIR");
  }
  const auto found = twoSolutions(options.scene == "fig1" ? 1 : 2, options.seed);
  if (!found) {
    printLines("no scene with two solutions that can be drawn among a thousand seeds\nFAILED\n");
    return exit_validation_failed;
  }
  if (options.output.json != "-") printLines(formatTwoSolutions(*found));
  if (!options.output.json.empty()) {
    writeJson(options.output.json, toJson(*found, invocation.command_line, options.seed));
  }
  writeTwoSolutionsReport(options.output.report, invocation.command_line, *found);
  return exit_fine;
}

int runCommand(const Options& options, const Invocation& invocation) {
  if (!options.scene.empty()) return runScene(options, invocation);
  if (options.table1) return runTable1(options, invocation);
  ViInitValidation validation;
  validation.checks = chosen(all_vi_init_checks, options.checks);
  validation.windows = options.windows;
  if (options.full) validation.trials = 4000, validation.recordings = 200;
  if (options.trials != 0) {
    validation.trials = options.trials;
    validation.recordings = std::max<std::size_t>(1, options.trials / 20);
  }
  validation.noise = options.noise;
  validation.seed = options.seed;
  validation.threads = options.threads;
  const std::vector<ViInitRow> rows =
      runTrials("validate vi-init", [&](const auto& progress) { return validateViInit(validation, progress); });
  if (endedBeforeTrials()) return exit_interrupted;
  if (rows.empty()) throw OptionError("--window", "none of these checks has windows of this length");
  return publish(
      options.output, invocation, options.seed, run_false_alarm, rows, formatViInitTables,
      [](const ViInitRow& row) { return toJson(row); }, writeViInitReport);
}

}  // namespace

void addValidateViInitCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app =
      validate.add("vi-init", "Visual-inertial initialisation: accuracy, covariances, and the cases it recognises");
  app.option(
         "--check", options->checks,
         "consistency, walk, closed_form, accuracy, gyroscope_bias, noise, rest, drift: a comma list (default: all)")
      .list()
      .oneOf(names(all_vi_init_checks));
  app.option("--window", options->windows, "Only windows of so many seconds, of 1, 2, 3, 4: a comma list")
      .list()
      .oneOfNumbers({1., 2., 3., 4.});
  app.option("--noise", options->noise, "Noise that is simulated over the one that the estimators are told (default 1)")
      .range(0.01, 100.0);
  app.flag("--full", options->full, "4000 windows a row, 200 recordings; no time limit");
  const Option table1 = app.flag("--table1", options->table1, "The paper's table of cases, as it is recognised");
  const Option scene =
      app.option("--scene", options->scene,
                 "fig1, fig2: draws the paper's figure of two solutions into the directory of --report")
          .oneOf({"fig1", "fig2"});
  table1.excludes("--check").excludes("--window").excludes("--noise");
  scene.excludes(table1).excludes("--check").excludes("--window").excludes("--noise").excludes("--full");
  addRunOptions(app, "600, with --full 4000; recordings a twentieth, scenes of --table1: 100, 1000", options->trials,
                options->seed, options->threads, options->output);
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
