#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judged_report.hpp>
#include <experiments/two_view_scene.hpp>
#include <stats/validation_report.hpp>

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

namespace liestat::experiments {

/// The simulated motions of `liestat validate two-view`: which model the hierarchy chooses, and whether the truth lies
/// where the covariance of the true model's estimate says. A motion of an optional model is tried with the default
/// lattice and that model.
struct TwoViewValidation {
  std::vector<TwoViewMotion> motions{default_two_view_motions.begin(), default_two_view_motions.end()};
  RunSize run{.trials = 50};  ///< trials of a motion
  std::size_t matches = 100;
  double outliers = 0.2;  ///< share of the matches
  double sigma = 0.5;     ///< px
};

/// Which model was chosen how often, by the number of its motion.
struct TwoViewChoice {
  TwoViewMotion truth = TwoViewMotion::none;
  std::size_t trials = 0;
  std::array<std::size_t, all_two_view_motions.size()> chosen = {};
  /// True if the right choices are within four standard errors of the promised share, or above it.
  std::optional<bool> passed;
  std::size_t right() const { return chosen[static_cast<std::size_t>(truth)]; }
  bool optional() const { return static_cast<std::size_t>(truth) >= default_two_view_motions.size(); }
};
/// The choices that a row of 500 trials is promised to reach: none under 90 %, 96 % on average over the nine
/// of the default lattice.
inline constexpr double promised_row = 0.9, promised_average = 0.96;

/// The squared distance of the true parameter from the true model's estimate.
struct TwoViewRow : JudgedReport {
  TwoViewMotion motion = TwoViewMotion::none;
};

struct TwoViewValidationResult {
  std::vector<TwoViewRow> rows;        ///< motions with a parameter
  std::vector<TwoViewChoice> choices;  ///< all motions
  std::optional<bool> average_passed;  ///< where all nine were asked for
  double average() const;              ///< share of right choices among them; NaN of none
};

template <class V>
void describe(V& v, const TwoViewRow& row) {
  v("motion", name(row.motion));
  describeReport(v, row.report);
  v("tail", row.tail)("failures", row.report.failures)("passed", row.passed);
}

/// The models that were chosen, as fields.
struct ChosenModels {
  const TwoViewChoice* choice = nullptr;
};
template <class V>
void describe(V& v, const ChosenModels& models) {
  for (std::size_t m = 0; models.choice != nullptr && m < all_two_view_motions.size(); ++m) {
    // The default lattice, and the model that this motion is tried with.
    if (m >= default_two_view_motions.size() && all_two_view_motions[m] != models.choice->truth) continue;
    v(name(all_two_view_motions[m]).c_str(), models.choice->chosen[m], "trials");
  }
}
template <class V>
void describe(V& v, const TwoViewChoice& choice) {
  v("motion", name(choice.truth))("trials", choice.trials)("chosen", ChosenModels{&choice})("passed", choice.passed);
}
template <class V>
void describe(V& v, const TwoViewValidationResult& result) {
  v("rows", result.rows)("choices", result.choices);
}

/// Runs everything; in the order of the motions.
TwoViewValidationResult validateTwoView(const TwoViewValidation& validation, const RunProgress& progress = {});

/// The promises: the distances, the choices, and their average.
Judgement judgementOf(const TwoViewValidationResult& result);

}  // namespace liestat::experiments
