#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/two_view_validation.hpp>

#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  TwoViewValidation validation;
  std::vector<std::string> motions;
  std::size_t trials = 0;
  bool full = false;
  ValidationOutput output;
};

int runCommand(const Options& options, const Invocation& invocation) {
  TwoViewValidation validation = options.validation;
  if (options.full || !options.motions.empty()) validation.motions = chosen(all_two_view_motions, options.motions);
  validation.trials = options.trials != 0 ? options.trials : options.full ? 500 : 50;
  const TwoViewValidationResult result =
      withProgressBar("validate two-view", [&](const auto& progress) { return validateTwoView(validation, progress); });
  FurtherRows choices{"choices", {}, result.tally()};
  for (const TwoViewChoice& choice : result.choices) choices.rows.push_back(toJson(choice));
  return publish(
      options.output, invocation, validation.seed, run_false_alarm, result.rows,
      [&](const auto&) { return formatTwoViewTables(result); }, [](const TwoViewRow& row) { return toJson(row); },
      [&](const std::string& directory, const std::string& command_line, const auto&) {
        writeTwoViewReport(directory, command_line, result);
      },
      choices);
}

std::string optionalNames() {
  std::string text;
  for (const TwoViewMotion motion : optional_two_view_motions) text += (text.empty() ? "" : ", ") + name(motion);
  return text;
}

}  // namespace

void addValidateTwoViewCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app =
      validate.add("two-view", "Motion between two images: is the right model chosen, and does its covariance hold?");
  app.option("--motion", options->motions,
             "none, retinal_translation, zoom, retinal_displacement, rotation, homography, translation, essential, "
             "fundamental, and of optional models " +
                 optionalNames() + ": a comma list (default: the first nine, with --full all)")
      .list()
      .oneOf(names(all_two_view_motions));
  app.option("--matches", options->validation.matches, "Matches of a trial (default 100)")
      .range(std::size_t{10}, std::size_t{100000});
  app.option("--outliers", options->validation.outliers, "Share of wrong matches (default 0.2)").range(0.0, 0.9);
  app.option("--sigma", options->validation.sigma, "Standard deviation of image coordinates, px (default 0.5)")
      .range(1e-3, 10.0);
  app.flag("--full", options->full, "500 trials a motion, optional models too");
  addRunOptions(app, "50, with --full 500", options->trials, options->validation.seed, options->validation.threads,
                options->output);
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
