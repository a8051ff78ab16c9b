#include <experiments/two_view_answers.hpp>

#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/two_view.hpp>
#include <lie/essential.hpp>
#include <lie/so3.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

namespace liestat::experiments {
namespace {

/// The 0.95 quantile of χ²₅.
constexpr double pose_limit = 11.070497693516351;
/// Right answers that may be contested, in the mean of the motions of the default lattice, and the share of truths
/// that may lie beyond a region of 95 %.
constexpr double max_right_contested = 0.08, max_outside = 0.07;

enum class Answer : std::uint8_t { right, wrong, withheld, in_set, chosen_in_set, not_in_set };
struct AnswerTrial {
  Answer answer = Answer::withheld;
  bool has_pose = false, outside = false;
};

AnswerTrial runAnswerTrial(const TwoViewSceneOptions& options, std::uint64_t seed) {
  const TwoViewScene scene(options, seed);
  TwoViewMotionOptions estimate;
  estimate.sigma = options.sigma;
  Camera& camera = estimate.first.emplace();
  camera.fu = camera.fv = options.focal_length;
  camera.cu = 0.5 * options.width, camera.cv = 0.5 * options.height;
  camera.width = static_cast<int>(options.width), camera.height = static_cast<int>(options.height);
  estimate.search.seed = seed;
  const TwoViewMotionEstimate found = estimateTwoViewMotion(scene.pixels, estimate);
  const std::string truth = nameOf(options.motion);
  const bool is_chosen = !found.lattice.empty() && found.chosenModel().name == truth;
  AnswerTrial trial;
  if (found.status == Status::contested) {
    const bool is_rival = std::any_of(found.rivals.begin(), found.rivals.end(),
                                      [&](const TwoViewRival& rival) { return rival.model == truth; });
    trial.answer = is_chosen ? Answer::chosen_in_set : is_rival ? Answer::in_set : Answer::not_in_set;
    return trial;
  }
  if (!found.ok()) return trial;
  trial.answer = is_chosen ? Answer::right : Answer::wrong;
  trial.has_pose = is_chosen && found.relative_pose.has_value();
  if (trial.has_pose) {
    const Essentiald pose(SO3d::fitToSO3(scene.R), scene.t);
    trial.outside = !(mahalanobisSquared(*found.relative_pose, pose) < pose_limit);
  }
  return trial;
}

/// True if `count` of `trials` is within four standard errors of a share, or below it.
bool isBelow(std::size_t count, std::size_t trials, double share) {
  const auto n = static_cast<double>(trials);
  return static_cast<double>(count) <= share * n + 4 * std::sqrt(share * (1 - share) * n);
}

struct AnswerScene {
  std::string name;
  TwoViewSceneOptions options;
  double max_wrong;
  std::optional<double> min_in_set;
};
std::vector<AnswerScene> answerScenes(const TwoViewAnswers& validation) {
  std::vector<AnswerScene> scenes;
  const auto sceneOf = [&](TwoViewMotion motion) {
    return TwoViewSceneOptions{
        .motion = motion, .matches = validation.matches, .outliers = validation.outliers, .sigma = validation.sigma};
  };
  for (const TwoViewMotion motion : default_two_view_motions) {
    scenes.push_back({nameOf(motion), sceneOf(motion), 0.01, 0.98});
  }
  // Wrong answers that may go unmarked at a parallax of 13 times the noise, and at less and more.
  for (const auto& [baseline, wrong] : {std::pair{0.03, 0.1}, {0.05, 0.04}, {0.08, 0.01}, {0.12, 0.01}}) {
    AnswerScene scene{fmt::format("pose, {:.0f} cm", 100 * baseline), sceneOf(TwoViewMotion::essential), wrong, {}};
    scene.options.min_baseline = scene.options.max_baseline = baseline;
    if (baseline >= 0.08) scene.min_in_set = 0.98;
    scenes.push_back(std::move(scene));
  }
  return scenes;
}

}  // namespace

std::vector<TwoViewAnswerRow> validateTwoViewAnswers(const TwoViewAnswers& validation, const RunProgress& progress) {
  const std::vector<AnswerScene> scenes = answerScenes(validation);
  CellRun run(validation.run, std::vector<CellSize>(scenes.size(), {validation.run.trials, 1}), progress);
  std::vector<TwoViewAnswerRow> rows;
  for (const AnswerScene& scene : scenes) {
    const std::vector<AnswerTrial> trials = run.outcomes(
        [&](std::uint64_t number) { return runAnswerTrial(scene.options, validation.run.seed * 1000003 + number); });
    if (run.ended()) continue;
    TwoViewAnswerRow row{.scene = scene.name, .trials = trials.size(), .max_wrong = scene.max_wrong};
    row.min_in_set = scene.min_in_set;
    for (const AnswerTrial& trial : trials) {
      row.right += trial.answer == Answer::right, row.wrong += trial.answer == Answer::wrong;
      row.contested += trial.answer >= Answer::in_set, row.right_contested += trial.answer == Answer::chosen_in_set;
      row.right_in_set += trial.answer == Answer::in_set || trial.answer == Answer::chosen_in_set;
      row.poses += trial.has_pose, row.outside += trial.outside;
    }
    row.marked = row.trials - row.right - row.wrong;
    const std::size_t answered = row.right + row.wrong + row.contested;
    row.passed = isBelow(row.wrong, row.trials, row.max_wrong) && isBelow(row.outside, row.poses, max_outside) &&
                 (!row.min_in_set || isBelow(answered - row.right - row.right_in_set, answered, 1 - *row.min_in_set));
    rows.push_back(std::move(row));
  }
  return rows;
}

Judgement judgementOf(const std::vector<TwoViewAnswerRow>& rows) {
  Judgement judgement{.promises = {}, .where = "of answers"};
  std::size_t contested = 0, all = 0;
  for (const TwoViewAnswerRow& row : rows) {
    judgement.promises.push_back(
        {row.scene, row.passed,
         fmt::format("{} of {} wrong and not marked ({:.0f} % may be), {} of {} poses beyond 95 %, right one in the "
                     "set of {} of {} contested ones",
                     row.wrong, row.trials, 100 * row.max_wrong, row.outside, row.poses, row.right_in_set,
                     row.contested),
         static_cast<double>(row.wrong), row.max_wrong * static_cast<double>(row.trials)});
    if (all >= default_two_view_motions.size() * row.trials) continue;
    contested += row.right_contested, all += row.trials;
  }
  judgement.promises.push_back({"right answers that are contested, mean of the motions",
                                all > 0 ? std::optional(isBelow(contested, all, max_right_contested)) : std::nullopt,
                                fmt::format("{:.0f} % may be", 100 * max_right_contested),
                                static_cast<double>(contested) / static_cast<double>(all), max_right_contested});
  return judgement;
}

}  // namespace liestat::experiments
