#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/two_view_scene.hpp>
#include <stats/verdict.hpp>

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The rules by which a model may be chosen, side by side over the same trials and the same estimates of all models.
struct TwoViewRuleComparison {
  RunSize run{.trials = 20};  ///< trials of a motion
  std::size_t matches = 100;
  double outliers = 0.2;
  double sigma = 0.5;  ///< px
};

/// How often a rule chose the right model.
struct TwoViewRuleRow {
  using OfMotions = std::array<std::size_t, default_two_view_motions.size()>;
  std::string rule;
  OfMotions trials{}, right{};
  double share(std::size_t motion) const;  ///< fraction of right choices; NaN without a trial
  double average() const;                  ///< share of right choices over the trials of all motions
  std::size_t worst() const;               ///< number of the motion with the smallest share
};

/// The default rule first; then tests with other bounds, the information criterion, GRIC and the geometric AIC. No rows
/// after an interrupt (experiments/interruption.hpp) before the first trial; later it leaves the first trials of the first
/// motions.
std::vector<TwoViewRuleRow> compareTwoViewRules(const TwoViewRuleComparison& comparison,
                                                const RunProgress& progress = {});

/// Right choices by the default rule, and by the best one. Nothing is promised of the rules.
Verdict verdictOf(const std::vector<TwoViewRuleRow>& rows);

/// The shares of right choices of a rule, as fields.
struct RightChoices {
  const TwoViewRuleRow* row = nullptr;
};
template <class V>
void describe(V& v, const RightChoices& choices) {
  for (std::size_t k = 0; choices.row != nullptr && k < default_two_view_motions.size(); ++k) {
    v(nameOf(default_two_view_motions[k]), choices.row->share(k), "share");
  }
}
template <class V>
void describe(V& v, const TwoViewRuleRow& row) {
  v("rule", row.rule)("trials", *std::max_element(row.trials.begin(), row.trials.end()), "of a motion");
  v("average", row.average(), "share of right choices")("right", RightChoices{&row});
}

}  // namespace liestat::experiments
