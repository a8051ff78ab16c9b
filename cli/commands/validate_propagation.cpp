#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/validations.hpp>
#include <experiments/propagation_validation.hpp>

#include <memory>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  std::vector<std::string> features, operations;
  std::vector<double> spreads;
  RunOptions run;
};

int runCommand(const Options& options, const Invocation& invocation) {
  PropagationValidation validation;
  validation.features = chosen(all_propagated, options.features);
  validation.operations = chosen(all_operations, options.operations);
  if (!options.spreads.empty()) validation.spreads = options.spreads;
  validation.run = options.run.size(validation.run.trials);
  const auto rows = runTrials("validate propagation",
                              [&](const auto& progress) { return validatePropagation(validation, progress); });
  return publish(options.run, invocation, viewOf(rows));
}

}  // namespace

void addValidatePropagationCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app = validate.add(
      "propagation", "Composition, inverse and action of uncertain features: up to which noise is first order right?");
  app.option("--feature", options->features, "rotation, pose, similarity: a comma list (default: all)")
      .list()
      .oneOf(names(all_propagated));
  app.option("--operation", options->operations,
             "compose, inverse, between, act, chain (of ten factors): a comma list (default: all)")
      .list()
      .oneOf(names(all_operations));
  app.option("--spread", options->spreads,
             "Largest standard deviations, rad and m, a comma list (default 0.01,0.03,0.1,0.2,0.3,0.5,1)")
      .list()
      .range(1e-6, 10.0);
  options->run.declare(app, "20000");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
