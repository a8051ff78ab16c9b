#include <experiments/two_view_validation.hpp>

#include <experiments/two_view_lattice.hpp>
#include <fusion/two_view/models.hpp>
#include <stats/hierarchy.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <limits>
#include <utility>

namespace liestat::experiments {
namespace {

std::size_t indexOf(const std::string& model) {
  std::size_t k = 0;
  while (k + 1 < all_two_view_motions.size() && nameOf(all_two_view_motions[k]) != model) ++k;
  return k;
}

struct Trial {
  std::size_t chosen = 0;
  std::optional<double> distance;
};

Trial runTrial(const TwoViewSceneOptions& options, std::uint64_t seed) {
  const TwoViewScene scene(options, seed);
  Hierarchy<Eigen::Vector4d, TwoViewMotionModel> search(modelsFor(scene), {.seed = seed});
  search.add(scene.matches);
  while (search.iterate()) {
  }
  Trial trial;
  trial.chosen = indexOf(search.models()[search.best()]->name());
  const std::size_t m = search.find(nameOf(options.motion));
  const auto& state = search.state(m);
  const int rank = search.models()[m]->freeParameters();
  if (!state.hasEstimate() || rank == 0) return trial;
  // Where all good estimates were refused there may be one from a few matches, which other models reject.
  if (options.motion == TwoViewMotion::shared_focal && search.best() != m) return trial;
  trial.distance = distanceOfTruth(scene, state.estimate, rank);
  return trial;
}

int dimensionOf(const TwoViewSceneOptions& options) {
  for (const auto& model : modelsFor(TwoViewScene(options, 0))) {
    if (model->name() == nameOf(options.motion)) return model->freeParameters();
  }
  return 0;
}

/// True if `right` of `trials` is within four standard errors of a share, or above it.
bool reaches(double right, double trials, double share) {
  return right >= share * trials - 4 * std::sqrt(share * (1 - share) * trials);
}

}  // namespace

double TwoViewValidationResult::average() const {
  double sum = 0, count = 0;
  for (const TwoViewChoice& c : choices) {
    if (c.optional()) continue;
    sum += static_cast<double>(c.right()) / static_cast<double>(c.trials), ++count;
  }
  return sum / count;
}

Judgement judgementOf(const TwoViewValidationResult& result) {
  Judgement judgement{.promises = {}, .where = "of distances and choices"};
  for (const TwoViewRow& row : result.rows) judgement.promises.push_back(promiseAbout(row, name(row.motion)));
  for (const TwoViewChoice& choice : result.choices) {
    judgement.promises.push_back({name(choice.truth), choice.passed,
                                  fmt::format("chosen in {} of {} trials, {:.0f} % are promised", choice.right(),
                                              choice.trials, 100 * promised_row),
                                  static_cast<double>(choice.right()),
                                  promised_row * static_cast<double>(choice.trials)});
  }
  judgement.promises.push_back({"mean of the diagonal", result.average_passed,
                                fmt::format("{:.0f} % are promised", 100 * promised_average), result.average(),
                                promised_average});
  return judgement;
}

TwoViewValidationResult validateTwoView(const TwoViewValidation& validation, const RunProgress& progress) {
  TwoViewValidationResult result;
  CellRun run(validation.run, std::vector<CellSize>(validation.motions.size(), {validation.run.trials, 1}), progress);
  for (const TwoViewMotion motion : validation.motions) {
    const TwoViewSceneOptions options{
        .motion = motion, .matches = validation.matches, .outliers = validation.outliers, .sigma = validation.sigma};
    const int k = dimensionOf(options);
    TwoViewChoice choice;
    const std::vector<Trial> trials = run.outcomes([&](std::uint64_t number) {
      try {
        return runTrial(options, validation.run.seed * 1000003 + number);
      } catch (const std::exception&) {
        return Trial{};
      }
    });
    if (run.ended()) continue;
    choice.truth = motion;
    choice.trials = trials.size();
    std::vector<double> distances;
    for (const Trial& trial : trials) {
      ++choice.chosen[trial.chosen];
      distances.push_back(trial.distance.value_or(std::numeric_limits<double>::quiet_NaN()));
    }
    choice.passed = reaches(static_cast<double>(choice.right()), static_cast<double>(choice.trials), promised_row);
    result.choices.push_back(choice);
    if (k == 0) continue;
    TwoViewRow row;
    row.motion = motion;
    // Errors beyond the 0.99 quantile are cut off, outliers below it are not: what that makes of the index, and the
    // curvature of the longest motions (docs/two_view.md).
    ValidationTolerance promise{.index = 0.1, .ks = 0.05, .failure_fraction = 0.01, .tail = 0.02};
    // One that may be refused has distances where it was chosen, and how often that is, is judged above.
    if (motion == TwoViewMotion::shared_focal) promise.failure_fraction = 1 - promised_row;
    row.conclude(reportOfDistances(distances, ReferenceLaw::chiSquared(k)), promise,
                 run_false_alarm / static_cast<double>(validation.motions.size()));
    result.rows.push_back(std::move(row));
  }
  if (trials_of_run.incomplete() || result.choices.empty()) return result;
  const auto asked = [&](TwoViewMotion motion) {
    return std::find(validation.motions.begin(), validation.motions.end(), motion) != validation.motions.end();
  };
  if (std::all_of(default_two_view_motions.begin(), default_two_view_motions.end(), asked)) {
    const auto nine = static_cast<double>(validation.run.trials * default_two_view_motions.size());
    result.average_passed = reaches(result.average() * nine, nine, promised_average);
  }
  return result;
}

}  // namespace liestat::experiments
