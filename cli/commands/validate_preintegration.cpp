#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/validations.hpp>
#include <experiments/preintegration_validation.hpp>

#include <memory>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  std::vector<std::string> checks;
  std::vector<double> windows, noises;
  RunOptions run;
};

int runCommand(const Options& options, const Invocation& invocation) {
  PreintegrationValidation validation;
  validation.checks = chosen(all_preintegration_checks, options.checks);
  if (!options.windows.empty()) validation.windows = options.windows;
  if (!options.noises.empty()) validation.noises = options.noises;
  validation.run = options.run.size(validation.run.trials);
  const auto rows = runTrials("validate preintegration",
                              [&](const auto& progress) { return validatePreintegration(validation, progress); });
  return publish(options.run, invocation, viewOf(rows));
}

}  // namespace

void addValidatePreintegrationCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app =
      validate.add("preintegration", "Motions preintegrated from noisy inertial readings: are their covariances true?");
  app.option("--check", options->checks, "motion, walk, motion_and_bias: a comma list (default: all)")
      .list()
      .oneOf(names(all_preintegration_checks));
  app.option("--window", options->windows, "Seconds, a comma list (default 0.1,0.5,1,2)").list().range(0.005, 100.0);
  app.option("--noise", options->noises, "Multiples of an ADIS16448's noise, a comma list (default 1,10,100)")
      .list()
      .range(1e-3, 1e4);
  options->run.declare(app, "2000");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
