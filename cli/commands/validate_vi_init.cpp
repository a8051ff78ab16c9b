#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <cli/show/validations.hpp>
#include <experiments/table1.hpp>
#include <experiments/two_solutions.hpp>
#include <experiments/vi_init_validation.hpp>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  std::vector<std::string> checks;
  std::vector<double> windows;
  double noise = 1;
  bool table1 = false;
  std::optional<int> figure;  ///< the scene with two solutions that is drawn
  RunOptions run;
};

int runTable1(const Options& options, const Invocation& invocation) {
  const auto rows = runTrials("validate vi-init --table1", [&](const auto& progress) {
    return recogniseTable1(options.run.size(100, 1000), progress);
  });
  return publish(options.run, invocation, viewOf(rows));
}

int runScene(const Options& options, const Invocation& invocation) {
  if (options.run.report.empty()) {
    throw OptionError("--scene", "draws into a directory and none is named", "--report DIR");
  }
  const auto found = twoSolutions(*options.figure, options.run.seed);
  if (found) return publish(options.run, invocation, viewOf(*found));
  printLines("no scene with two solutions that can be drawn among a thousand seeds\nFAILED\n");
  return exit_validation_failed;
}

int runCommand(const Options& options, const Invocation& invocation) {
  options.run.begin(invocation);
  if (options.figure) return runScene(options, invocation);
  if (options.table1) return runTable1(options, invocation);
  ViInitValidation validation;
  validation.checks = chosen(all_vi_init_checks, options.checks);
  validation.windows = options.windows;
  validation.noise = options.noise;
  validation.run = options.run.size(600, 4000);
  validation.recordings = options.run.trials != 0 ? std::max<std::size_t>(1, options.run.trials / 20)
                          : options.run.full      ? 200
                                                  : validation.recordings;
  const auto rows =
      runTrials("validate vi-init", [&](const auto& progress) { return validateViInit(validation, progress); });
  if (rows.empty() && experiments::trials_of_run.planned == 0) {
    throw OptionError("--window", "none of these checks has windows of this length");
  }
  return publish(options.run, invocation, viewOf(rows));
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
  app.flag("--full", options->run.full, "4000 windows a row, 200 recordings; no time limit");
  const Option table1 = app.flag("--table1", options->table1, "The paper's table of cases, as it is recognised");
  const Option scene =
      app.choice("--scene", options->figure, std::vector<std::pair<std::string, int>>{{"fig1", 1}, {"fig2", 2}},
                 "fig1, fig2: draws the paper's figure of two solutions into the directory of --report");
  table1.excludes("--check").excludes("--window").excludes("--noise");
  scene.excludes(table1).excludes("--check").excludes("--window").excludes("--noise").excludes("--full");
  options->run.declare(app, "600, with --full 4000; recordings a twentieth, scenes of --table1: 100, 1000");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
