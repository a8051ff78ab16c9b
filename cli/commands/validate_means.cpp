#include <cli/commands/commands.hpp>
#include <cli/commands/validation_command.hpp>
#include <cli/show/validations.hpp>
#include <experiments/means_validation.hpp>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

struct Options {
  std::vector<std::string> features, noises, criteria;
  std::vector<std::size_t> n;
  std::vector<double> spreads;
  std::optional<CovarianceAt> covariance_at;
  bool certify = false;
  RunOptions run;
};

/// The front door's cells of the chosen features; none where the run is about certain rows of the experiments.
std::vector<VerdictCell> chosenCells(const Options& options, const std::vector<Feature>& features) {
  const bool narrowed = !options.noises.empty() || !options.criteria.empty() || !options.n.empty() ||
                        !options.spreads.empty() || options.covariance_at == CovarianceAt::measured;
  std::vector<VerdictCell> cells;
  if (narrowed) return cells;
  for (VerdictCell cell : verdictCells(options.run.full)) {
    if (std::find(features.begin(), features.end(), cell.feature) == features.end()) continue;
    if (options.run.trials != 0) cell.trials = std::min(cell.trials, options.run.trials);
    cells.push_back(cell);
  }
  return cells;
}

int runCommand(const Options& options, const Invocation& invocation) {
  MeansValidation validation;
  validation.features = chosen(all_features, options.features);
  validation.noises = chosen(all_noises, options.noises);
  validation.criteria = chosen(all_criteria, options.criteria);
  if (!options.n.empty()) validation.n = options.n;
  validation.spreads = options.spreads;
  if (options.run.full && validation.spreads.empty()) validation.spreads = {1.0 / 3, 1.0};
  validation.covariance_at = options.covariance_at.value_or(CovarianceAt::estimated);
  validation.run = options.run.size(1000, 4000);
  validation.certify = options.certify || options.run.full;
  validation.all_printed = options.run.full;

  MeansValidationResult result;
  result.rows = runTrials("validate means", [&](const auto& progress) { return validateMeans(validation, progress); });
  result.verdicts = runTrials("verdicts", [&](const auto& progress) {
    return judgeVerdicts(chosenCells(options, validation.features), options.run.seed, options.run.threads, progress);
  });
  return publish(options.run, invocation, viewOf(result));
}

}  // namespace

void addValidateMeansCommand(const CommandList& validate) {
  auto options = std::make_shared<Options>();
  const Command app = validate.add("means", "Means of features: Monte-Carlo validation of their covariances");
  app.option("--feature", options->features, "Features, a comma list").list().oneOf(names(all_features));
  app.option("--noise", options->noises, "Noises, a comma list").list().oneOf(names(all_noises));
  app.option("--criterion", options->criteria, "Criteria, a comma list").list().oneOf(names(all_criteria));
  app.option("--n", options->n, "Numbers of measurements, a comma list (default 5,10,20,30,50,100)")
      .list()
      .range(std::size_t{2}, std::size_t{1000000});
  app.option("--spread", options->spreads,
             "Factors of the report's standard deviations, a comma list (default 1, frames 1/3)")
      .list()
      .range(1e-9, 10.0);
  app.choice<CovarianceAt>("--covariance-at", options->covariance_at,
                           {{"estimated", CovarianceAt::estimated}, {"measured", CovarianceAt::measured}},
                           "Frame in which the noise of frames is Gaussian and MAHA takes its covariances");
  options->run.declare(app, "1000, with --full 4000");
  app.flag("--certify", options->certify, "Certify the global minimum of LSQ and WLSQ by branch and bound");
  app.flag("--full", options->run.full,
           "4000 trials, both spreads, certified minima, all printed formulas; no time limit");
  app.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
