#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <experiments/two_view_pair_files.hpp>
#include <cli/show/two_view_pairs.hpp>
#include <cli/show/two_view_rules.hpp>
#include <cli/show/two_view_validation.hpp>
#include <experiments/two_view_rules.hpp>

#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  TwoViewValidation validation;
  std::vector<std::string> motions;
  std::size_t trials = 0;
  std::optional<double> sigma;
  bool full = false, rules = false;
  std::string pairs;
  bool all_matches = false;
  ValidationOutput output;
};

int runPairs(const Options& options, const Invocation& invocation) {
  const std::vector<TwoViewPair> pairs = readTwoViewPairs(options.pairs);
  TwoViewPairsValidation validation;
  validation.sigma = options.sigma.value_or(validation.sigma);
  validation.runs = options.trials != 0 ? options.trials : validation.runs;
  validation.seed = options.validation.seed, validation.threads = options.validation.threads;
  validation.contradicted = options.all_matches;
  const TwoViewPairsResult result = runTrials(
      "validate two-view", [&](const auto& progress) { return validateTwoViewPairs(pairs, validation, progress); });
  if (endedBeforeTrials()) return exit_interrupted;
  if (options.output.json != "-") printLines(formatTwoViewPairs(result));
  if (!options.output.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line, validation.seed);
    setVerdict(object, result.tally().failed == 0);
    writeJson(options.output.json, toJson(result, std::move(object)));
  }
  if (!options.output.report.empty()) {
    writeTwoViewPairsReport(options.output.report, invocation.command_line, result);
  }
  return exitCode(result.tally().failed == 0);
}

/// Nothing is promised of the rules, so nothing is judged.
int compareRules(const Options& options, const Invocation& invocation) {
  TwoViewRuleComparison comparison;
  comparison.trials = options.trials != 0 ? options.trials : options.full ? 500 : 20;
  comparison.seed = options.validation.seed, comparison.threads = options.validation.threads;
  comparison.matches = options.validation.matches, comparison.outliers = options.validation.outliers;
  comparison.sigma = options.sigma.value_or(comparison.sigma);
  const std::vector<TwoViewRuleRow> rows =
      runTrials("validate two-view", [&](const auto& progress) { return compareTwoViewRules(comparison, progress); });
  if (endedBeforeTrials()) return exit_interrupted;
  if (options.output.json != "-") printLines(formatTwoViewRules(rows));
  if (!options.output.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line, comparison.seed);
    std::vector<JsonObject> list;
    for (const TwoViewRuleRow& row : rows) list.push_back(toJson(row));
    writeJson(options.output.json, setInterrupted(object).set("rules", list));
  }
  if (!options.output.report.empty()) {
    writeTwoViewRulesReport(options.output.report, invocation.command_line, rows);
  }
  return exitCode(true);
}

int runCommand(const Options& options, const Invocation& invocation) {
  if (!options.pairs.empty()) return runPairs(options, invocation);
  if (options.rules) return compareRules(options, invocation);
  TwoViewValidation validation = options.validation;
  validation.sigma = options.sigma.value_or(validation.sigma);
  if (options.full || !options.motions.empty()) validation.motions = chosen(all_two_view_motions, options.motions);
  validation.trials = options.trials != 0 ? options.trials : options.full ? 500 : 50;
  const TwoViewValidationResult result =
      runTrials("validate two-view", [&](const auto& progress) { return validateTwoView(validation, progress); });
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
  app.option("--sigma", options->sigma, "Standard deviation of image coordinates, px (default 0.5, of real pairs 1)")
      .range(1e-3, 10.0);
  app.flag("--full", options->full, "500 trials a motion, optional models too");
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
  addRunOptions(app, "50, with --full 500, of real pairs 10", options->trials, options->validation.seed,
                options->validation.threads, options->output);
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
