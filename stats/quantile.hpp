// Quantiles of a few values, and the usual distance of times. (Needs the standard library alone.)
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

/// The p-quantile of some values by the nearest rank: the one of rank p (n - 1) in ascending order, from 0, rounded, so
/// that it is one of them (of an even number the median is the upper of the middle two). NaN for none. Infinite values
/// may be among them, NaN may not.
inline double quantile(std::vector<double> values, double p) {
  if (values.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto at = values.begin() + std::lround(p * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// The median of the differences of successive times, the larger of two middle ones; 0 for fewer than two times.
inline double medianStep(std::span<const double> times) {
  if (times.size() < 2) return 0;
  std::vector<double> steps;
  for (std::size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
  return quantile(std::move(steps), 0.5);
}

}  // namespace liestat
