#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <formats/two_view_pairs.hpp>
#include <cli/show/validations.hpp>
#include <experiments/two_view_pairs.hpp>
#include <experiments/two_view_rules.hpp>
#include <experiments/two_view_validation.hpp>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  TwoViewValidation validation;
  std::vector<std::string> motions;
  std::optional<double> sigma;
  bool rules = false;
  std::string pairs;
  bool all_matches = false;
  RunOptions run;
};

constexpr const char* bar = "validate two-view";

int runPairs(const Options& options, const Invocation& invocation) {
  const std::vector<TwoViewPair> pairs = readTwoViewPairs(options.pairs);
  TwoViewPairsValidation validation{.run = options.run.size(10), .contradicted = options.all_matches};
  validation.sigma = options.sigma.value_or(validation.sigma);
  const auto result =
      runTrials(bar, [&](const auto& progress) { return validateTwoViewPairs(pairs, validation, progress); });
  return publish(options.run, invocation, viewOf(result));
}

int compareRules(const Options& options, const Invocation& invocation) {
  TwoViewRuleComparison comparison{
      .run = options.run.size(20, 500), .matches = options.validation.matches, .outliers = options.validation.outliers};
  comparison.sigma = options.sigma.value_or(comparison.sigma);
  const auto rows = runTrials(bar, [&](const auto& progress) { return compareTwoViewRules(comparison, progress); });
  return publish(options.run, invocation, viewOf(rows));
}

int runCommand(const Options& options, const Invocation& invocation) {
  if (!options.pairs.empty()) return runPairs(options, invocation);
  if (options.rules) return compareRules(options, invocation);
  TwoViewValidation validation = options.validation;
  validation.sigma = options.sigma.value_or(validation.sigma);
  if (options.run.full || !options.motions.empty()) validation.motions = chosen(all_two_view_motions, options.motions);
  validation.run = options.run.size(50, 500);
  const auto result = runTrials(bar, [&](const auto& progress) { return validateTwoView(validation, progress); });
  return publish(options.run, invocation, viewOf(result));
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
  app.option("--sigma", options->sigma, "Standard deviation of image coordinates, px (default 0.5, of real pairs 1)")
      .range(1e-3, 10.0);
  app.flag("--full", options->run.full, "500 trials a motion, optional models too");
  app.option("--pairs", options->pairs,
             "Real pairs instead: a directory with the folders homogr, kusvod2, adelaide-rmf, evd, or some of them")
      .excludes("--motion")
      .excludes("--matches")
      .excludes("--outliers")
      .excludes("--full");
  app.flag("--all-matches", options->all_matches, "Also matches of --pairs that contradict each other");
  app.flag("--rules", options->rules,
           "Compare rules by which the model may be chosen instead; all models are estimated")
      .excludes("--pairs")
      .excludes("--motion");
  options->run.declare(app, "50, with --full 500, of real pairs 10");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
