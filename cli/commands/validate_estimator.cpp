#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/estimator_validation.hpp>

#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  EstimatorValidation validation;
  std::vector<std::string> experiments;
  std::size_t trials = 0;
  bool full = false;
  ValidationOutput output;
};

int runCommand(const Options& options, const Invocation& invocation) {
  EstimatorValidation validation = options.validation;
  validation.experiments = chosen(all_estimator_experiments, options.experiments);
  validation.trials = options.trials != 0 ? options.trials : options.full ? 40000 : 2000;
  const std::vector<EstimatorRow> rows =
      runTrials("validate estimator", [&](const auto& progress) { return validateEstimator(validation, progress); });
  return publish(
      options.output, invocation, validation.seed, run_false_alarm, rows, formatEstimatorTables,
      [](const EstimatorRow& row) { return toJson(row); }, writeEstimatorReport);
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
  app.flag("--full", options->full, "40000 trials a row");
  addRunOptions(app, "2000, with --full 40000", options->trials, options->validation.seed, options->validation.threads,
                options->output);
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
