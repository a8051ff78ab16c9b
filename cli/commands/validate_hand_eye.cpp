#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/validations.hpp>
#include <experiments/hand_eye_validation.hpp>

#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  HandEyeValidation validation;
  std::vector<std::string> experiments;
  RunOptions run;
};

int runCommand(const Options& options, const Invocation& invocation) {
  HandEyeValidation validation = options.validation;
  validation.experiments = chosen(all_hand_eye_experiments, options.experiments);
  validation.run = options.run.size(100, 2000);
  validation.many_pairs = options.run.full;
  const auto rows =
      runTrials("validate hand-eye", [&](const auto& progress) { return validateHandEye(validation, progress); });
  return publish(options.run, invocation, viewOf(rows));
}

}  // namespace

void addValidateHandEyeCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app = validate.add(
      "hand-eye", "Hand-eye calibration: errors, covariance, open directions of degenerate motions, wrong pairs");
  app.option("--experiment", options->experiments,
             "accuracy, motions, outliers, formulations: a comma list (default: all)")
      .list()
      .oneOf(names(all_hand_eye_experiments));
  app.option("--noise-factor", options->validation.noise_factor,
             "Standard deviation of the noise over what the estimator is told (default 1)")
      .range(0.01, 100.0);
  app.flag("--full", options->run.full, "2000 trials a row, and rows with 200 pairs");
  options->run.declare(app, "100, with --full 2000");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
