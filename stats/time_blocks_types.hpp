// The result of stats/time_blocks.hpp. (Needs the standard library alone.)
#pragma once

#include <stats/noise_fit.hpp>
#include <stats/verdict.hpp>
#include <stats/words.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

namespace liestat {

/// Below this p the errors of successive rows are called dependent.
inline constexpr double dependent_rows = refutation_level;

/// Measurements with times: whether halves made of blocks of time agree as well as the covariance of their mean says.
struct TimeBlocks {
  std::size_t blocks = 0, splits = 0;
  /// Squared distances of halves over what is expected: by so much the covariance of the mean is too small.
  double factor = std::numeric_limits<double>::quiet_NaN();
  double low = std::numeric_limits<double>::quiet_NaN();   ///< lower end of its 95 % interval
  double high = std::numeric_limits<double>::quiet_NaN();  ///< upper end
  double p = 1;               ///< probability of so large a factor, if rows are independent
  bool applied = false;       ///< the covariance was multiplied by inflation()
  bool too_many = false;      ///< rows: the test would cost more than the mean
  std::string why_none = {};  ///< the reason, where nothing was tested

  bool tested() const { return std::isfinite(factor); }
  /// The errors of successive rows depend on each other.
  bool dependent() const { return tested() && p < dependent_rows; }
  /// By which the covariance of the mean is to be multiplied; at least one, since a small factor shows nothing.
  double inflation() const { return tested() ? std::max(1.0, factor) : 1.0; }

  Verdict verdict() const {
    if (!tested()) return Verdict::none(why_none);
    const std::string range = significant(factor, 3) +
                              " times the expected squared distance (95 %: " + significant(low, 3) + " to " +
                              significant(high, 3) + ")";
    const std::string halves = "halves made of " + std::to_string(blocks) + " blocks of time differ by " + range;
    if (!dependent()) return Verdict::yes("nothing speaks against independent errors: " + halves);
    return Verdict::no("the errors of successive rows are not independent: " + halves +
                       ", so the standard deviations of the mean are about " + significant(std::sqrt(factor), 2) +
                       " times too small (--inflate multiplies them)");
  }
};

template <class V>
void describe(V& v, const TimeBlocks& b) {
  v("blocks", b.blocks, "of time")("splits", b.splits, "of the blocks into two halves");
  v("factor", b.factor, "squared distances of halves over what is expected");
  v("factor_low", b.low, "lower end of its 95 % interval")("factor_high", b.high, "upper end");
  v("p", b.p, "probability of so large a factor, if rows are independent");
  v("applied", b.applied, "whether the covariance was multiplied by the factor, where it is above one");
}

}  // namespace liestat
