#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/robust_validation.hpp>

#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  RobustValidation validation;
  std::vector<std::string> structures, scores;
  std::vector<double> outliers;
  std::size_t trials = 0;
  bool full = false;
  ValidationOutput output;
};

int runCommand(const Options& options, const Invocation& invocation) {
  RobustValidation validation = options.validation;
  validation.structures = chosen(all_robust_structures, options.structures);
  validation.scores = chosen(all_robust_scores, options.scores);
  if (!options.outliers.empty()) validation.outliers = options.outliers;
  validation.trials = options.trials != 0 ? options.trials : options.full ? 2000 : 100;
  const RobustValidationResult result =
      runTrials("validate robust", [&](const auto& progress) { return validateRobust(validation, progress); });
  // The share of structures that were found is judged beside the distances.
  FurtherRows thresholds{"thresholds", {}, result.tally()};
  for (const ThresholdRow& row : result.thresholds) thresholds.rows.push_back(toJson(row));
  return publish(
      options.output, invocation, validation.seed, run_false_alarm, result.rows,
      [&](const auto&) { return formatRobustTables(result); }, [](const RobustRow& row) { return toJson(row); },
      [&](const std::string& directory, const std::string& command_line, const auto&) {
        writeRobustReport(directory, command_line, result);
      },
      thresholds);
}

}  // namespace

void addValidateRobustCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app = validate.add(
      "robust", "Robust search among outliers: is the structure found, and is the covariance of what is found true?");
  app.option("--structure", options->structures, "conic, homography: a comma list (default: both)")
      .list()
      .oneOf(names(all_robust_structures));
  app.option("--score", options->scores,
             "relevance, truncated_cost, inlier_count, trimmed_quantile: a comma list (default: all)")
      .list()
      .oneOf(names(all_robust_scores));
  app.option("--outliers", options->outliers, "Shares of wrong measurements, a comma list (default 0,0.3,0.5,0.7)")
      .list()
      .range(0.0, 0.9);
  app.option("--measurements", options->validation.measurements, "Measurements of a trial (default 100)")
      .range(std::size_t{20}, std::size_t{100000});
  app.option("--confidence", options->validation.confidence,
             "Probability with which one of the draws is of inliers alone (default 0.99)")
      .range(0.1, 0.999999);
  app.option("--draws", options->validation.draw_factor, "So many times the draws that this takes (default 1)")
      .range(0.01, 1000.0);
  app.option("--noise-factor", options->validation.noise_factor,
             "Standard deviation of the noise over what the search is told (default 1)")
      .range(0.01, 100.0);
  app.flag("--full", options->full, "2000 trials a row");
  addRunOptions(app, "100, with --full 2000", options->trials, options->validation.seed, options->validation.threads,
                options->output);
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
