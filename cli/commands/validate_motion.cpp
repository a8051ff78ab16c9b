#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/validations.hpp>
#include <experiments/motion_validation.hpp>

#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  MotionValidation validation;
  std::vector<std::string> methods;
  RunOptions run;
};

int runCommand(const Options& options, const Invocation& invocation) {
  MotionValidation validation = options.validation;
  validation.methods = chosen(all_motion_methods, options.methods);
  validation.run = options.run.size(300, 2000);
  const auto rows =
      runTrials("validate motion", [&](const auto& progress) { return validateMotion(validation, progress); });
  return publish(options.run, invocation, viewOf(rows));
}

}  // namespace

void addValidateMotionCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app = validate.add(
      "motion", "Recursive motion from tracks: is the direction found, how well, and is its covariance true?");
  app.option("--method", options->methods,
             "subspace, essential, composition, gyroscope …: a comma list (default: all; docs/validation.md)")
      .list()
      .oneOf(names(all_motion_methods));
  app.option("--noise-factor", options->validation.noise_factor,
             "Standard deviation of the noise over what the filters are told (default 1)")
      .range(0.01, 100.0);
  app.flag("--full", options->run.full, "2000 trials a row");
  options->run.declare(app, "300, with --full 2000");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
