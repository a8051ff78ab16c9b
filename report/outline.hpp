// Long series as a page can show them.
#pragma once

#include <report/page.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat {

/// A series of lines, points or a filled curve over ascending x as its smallest and largest values in so many spans: on a
/// screen it looks the same. One that is not longer than four times that stays as it is.
inline Series outlineOf(const Series& series, std::size_t spans = 1000) {
  const std::size_t n = series.x.size();
  if (n <= 4 * spans) return series;
  const bool is_band = series.style == Style::filled_curve;
  Series outline = series;
  for (auto* list : {&outline.x, &outline.y, &outline.low, &outline.high}) list->clear();
  for (std::size_t k = 0; k < spans; ++k) {
    const std::size_t begin = k * n / spans, end = (k + 1) * n / spans;
    // They stay at the first value if none is finite.
    std::size_t least = begin, most = begin;
    const std::vector<double>&low = is_band ? series.low : series.y, &high = is_band ? series.high : series.y;
    for (std::size_t i = begin; i < end; ++i) {
      if (low[i] < low[least] || !std::isfinite(low[least])) least = i;
      if (high[i] > high[most] || !std::isfinite(high[most])) most = i;
    }
    if (is_band) {
      outline.x.push_back(series.x[begin]), outline.low.push_back(low[least]), outline.high.push_back(high[most]);
      continue;
    }
    for (const std::size_t i : {std::min(least, most), std::max(least, most)}) {
      outline.x.push_back(series.x[i]), outline.y.push_back(series.y[i]);
    }
  }
  return outline;
}

}  // namespace liestat
