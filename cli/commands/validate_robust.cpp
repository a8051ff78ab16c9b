#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/validations.hpp>
#include <experiments/robust_validation.hpp>

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
  RunOptions run;
};

int runCommand(const Options& options, const Invocation& invocation) {
  RobustValidation validation = options.validation;
  validation.structures = chosen(all_robust_structures, options.structures);
  validation.scores = chosen(all_robust_scores, options.scores);
  if (!options.outliers.empty()) validation.outliers = options.outliers;
  validation.run = options.run.size(100, 2000);
  const auto result =
      runTrials("validate robust", [&](const auto& progress) { return validateRobust(validation, progress); });
  return publish(options.run, invocation, viewOf(result));
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
  app.flag("--full", options->run.full, "2000 trials a row");
  options->run.declare(app, "100, with --full 2000");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
