// The usual distance of stamps. (Needs the standard library alone.)
#pragma once

#include <algorithm>
#include <cstddef>
#include <span>
#include <vector>

namespace liestat {

/// The median of the differences of successive times, the larger of two middle ones; 0 for fewer than two times.
inline double medianStep(std::span<const double> times) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < times.size(); ++i) steps.push_back(times[i] - times[i - 1]);
  if (steps.empty()) return 0;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  return *middle;
}

}  // namespace liestat
