#pragma once

#include <experiments/two_view_scene.hpp>

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace liestat::experiments {

/// The rules by which a model may be chosen, side by side over the same trials and the same estimates of all models.
struct TwoViewRuleComparison {
  std::size_t trials = 20;  ///< a motion
  std::uint64_t seed = 1;
  int threads = 0;
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
std::vector<TwoViewRuleRow> compareTwoViewRules(
    const TwoViewRuleComparison& comparison,
    const std::function<void(std::uint64_t done, std::uint64_t all)>& progress = {});

}  // namespace liestat::experiments
