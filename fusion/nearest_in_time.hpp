// The stamp nearest to a time, by which poses of two clocks or files are associated.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

namespace liestat {

/// The index of the time nearest to t if `shift` is added to the times, which ascend: of two as near the earlier one, of
/// equal ones the first. 0 for an empty list.
inline std::size_t nearestInTime(std::span<const double> times, double t, double shift = 0) {
  if (times.empty()) return 0;
  const auto at = std::lower_bound(times.begin(), times.end(), t, [&](double x, double y) { return x + shift < y; });
  auto k = static_cast<std::size_t>(at - times.begin());
  const auto difference = [&](std::size_t j) { return std::abs(times[j] + shift - t); };
  if (k == times.size() || (k > 0 && difference(k - 1) <= difference(k))) --k;
  while (k > 0 && times[k - 1] == times[k]) --k;
  return k;
}

}  // namespace liestat
