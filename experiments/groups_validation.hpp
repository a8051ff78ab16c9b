#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/rate.hpp>

#include <cstddef>
#include <string>
#include <vector>

namespace liestat::experiments {

/// A run of `liestat validate groups`.
struct GroupsValidation {
  RunSize run{.trials = 1000};  ///< trials of a row
};

/// Comparisons of groups of normal features with one mean, the smallest of max(10, 4 d) features. Rates: comparisons that
/// were made, and rejections at 5 % by each of the tests.
struct GroupRow {
  std::string groups;  ///< the feature, deviations and sizes
  std::size_t n = 0, trials = 0;
  std::vector<Rate> rates = {};

  const std::string& title() const { return groups; }
};
template <class V>
void describe(V& v, const GroupRow& row) {
  v("groups", row.groups)("n", row.n, "features of the smallest group")("trials", row.trials)("rates", row.rates);
}

std::vector<GroupRow> validateGroups(const GroupsValidation& validation, const RunProgress& progress = {});

}  // namespace liestat::experiments
