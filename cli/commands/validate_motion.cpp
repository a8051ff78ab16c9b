#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/motion_validation.hpp>

#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  MotionValidation validation;
  std::vector<std::string> methods;
  std::size_t trials = 0;
  bool full = false;
  ValidationOutput output;
};

int runCommand(const Options& options, const Invocation& invocation) {
  MotionValidation validation = options.validation;
  validation.methods = chosen(all_motion_methods, options.methods);
  validation.trials = options.trials != 0 ? options.trials : options.full ? 2000 : 300;
  const std::vector<MotionRow> rows =
      runTrials("validate motion", [&](const auto& progress) { return validateMotion(validation, progress); });
  return publish(
      options.output, invocation, validation.seed, run_false_alarm, rows,
      [](const auto& list) { return formatMotionTables(list); }, [](const MotionRow& row) { return toJson(row); },
      [](const std::string& directory, const std::string& command_line, const auto& list) {
        writeMotionReport(directory, command_line, list);
      });
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
  app.flag("--full", options->full, "2000 trials a row");
  addRunOptions(app, "300, with --full 2000", options->trials, options->validation.seed, options->validation.threads,
                options->output);
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
