#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judgement.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The answers that a user of estimateTwoViewMotion() gets: over the motions of the default lattice, and over poses whose
/// baselines come near the noise, how often an answer that is wrong is marked.
struct TwoViewAnswers {
  RunSize run{.trials = 20};  ///< trials of a scene
  std::size_t matches = 100;
  double outliers = 0.1;
  double sigma = 0.5;  ///< px
};

/// The answers about one kind of scene. Each trial is one of `right`, `marked` and `wrong`.
struct TwoViewAnswerRow {
  std::string scene;
  std::size_t trials = 0;
  std::size_t right = 0;                        ///< ok, and the right model
  std::size_t marked = 0;                       ///< not ok
  std::size_t wrong = 0;                        ///< ok, and another model
  std::size_t contested = 0, right_in_set = 0;  ///< of the marked ones; with the right model in the set
  std::size_t right_contested = 0;              ///< contested although the right model was chosen
  /// Right ones with a relative pose, and those of them with the truth outside of the region of 95 %.
  std::size_t poses = 0, outside = 0;
  /// The largest share of wrong answers, and the smallest of answers whose set has the right model; none is promised
  /// where it is absent.
  double max_wrong = 1;
  std::optional<double> min_in_set = {};
  std::optional<bool> passed = {};  ///< all promises within four standard errors
};

template <class V>
void describe(V& v, const TwoViewAnswerRow& row) {
  v("scene", row.scene)("trials", row.trials)("right", row.right, "ok, and the right model");
  v("marked", row.marked, "not ok")("wrong", row.wrong, "ok, and another model")("contested", row.contested);
  v("right_in_set", row.right_in_set, "contested, with the right model in the set");
  v("right_contested", row.right_contested, "contested although the right model was chosen");
  v("poses", row.poses, "right ones with a relative pose")("outside", row.outside,
                                                           "of these beyond the region of 95 %");
  v("passed", row.passed);
}

/// A row for each scene, in the order in which they end; none after an interrupt.
std::vector<TwoViewAnswerRow> validateTwoViewAnswers(const TwoViewAnswers& validation,
                                                     const RunProgress& progress = {});

/// The promises of docs/two_view.md about statuses.
Judgement judgementOf(const std::vector<TwoViewAnswerRow>& rows);

}  // namespace liestat::experiments
