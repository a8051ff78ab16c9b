#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/validations.hpp>
#include <experiments/estimator_validation.hpp>

#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  EstimatorValidation validation;
  std::vector<std::string> experiments;
  RunOptions run;
};

int runCommand(const Options& options, const Invocation& invocation) {
  EstimatorValidation validation = options.validation;
  validation.experiments = chosen(all_estimator_experiments, options.experiments);
  validation.run = options.run.size(2000, 40000);
  const auto rows =
      runTrials("validate estimator", [&](const auto& progress) { return validateEstimator(validation, progress); });
  return publish(options.run, invocation, viewOf(rows));
}

}  // namespace

void addValidateEstimatorCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app = validate.add(
      "estimator", "Constrained estimation: do minimum, covariance and corrected measurements follow their laws?");
  app.option("--experiment", options->experiments,
             "conic, corrected_points, rotation_numbers, rotation, prior_numbers, prior, homography, fundamental: a "
             "comma list (default: all)")
      .list()
      .oneOf(names(all_estimator_experiments));
  app.option("--noise-factor", options->validation.noise_factor,
             "Standard deviation of the noise over what the estimator is told (default 1)")
      .range(0.01, 100.0);
  app.flag("--full", options->run.full, "40000 trials a row");
  options->run.declare(app, "2000, with --full 40000");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
