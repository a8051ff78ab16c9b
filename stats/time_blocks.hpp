// Are the errors of successive measurements independent? The covariance of a mean supposes it. Halves made of blocks of
// time differ by more than their covariances say if errors hold on for longer than a measurement, and by which factor
// the covariance of the mean is too small follows (stats/split_validation.hpp; needs Boost.Math).
//
//   const auto by_blocks = [&](const SplitOptions& how) {
//     return validateMeanBySplitting(executor, samples, weights, {}, times, how).by_blocks;
//   };
//   const TimeBlocks found = compareTimeBlocks(n, 3, false, by_blocks);
//   if (found.dependent()) covariance *= found.inflation();
#pragma once

#include <stats/mean_summary.hpp>
#include <stats/split_validation_types.hpp>
#include <stats/time_blocks_types.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace liestat {

/// How compareTimeBlocks() splits. Splits cost two means each: with many rows there are fewer of them, and beyond
/// `max_rows` none.
struct TimeBlockOptions {
  SplitOptions split = {};
  std::size_t max_rows = 200000;
  std::size_t max_split_rows = 2000000;  ///< rows of all splits together
  std::size_t min_splits = 20;
};

/// Compares blocks of time of n measurements of a type with `dof` degrees of freedom. `by_blocks(SplitOptions)` is the
/// SplitSeries of the measurements' validation by splits. Nothing is tested, and `why_none` says why, if there are too
/// many measurements or too few, or if no split has an estimate.
template <class ByBlocks>
TimeBlocks compareTimeBlocks(std::size_t n, int dof, bool known_noise, const ByBlocks& by_blocks,
                             const TimeBlockOptions& options = {}) {
  TimeBlocks found;
  if (n > options.max_rows) {
    found.too_many = true;
    found.why_none =
        "the rows have times, but are too many for a comparison of blocks of time: see liestat validate split";
    return found;
  }
  if (n < fewestMeasurements(dof, known_noise, options.split)) {
    found.why_none = "too few rows for a comparison of blocks of time";
    return found;
  }
  SplitOptions split = options.split;
  split.splits = std::clamp(options.max_split_rows / n, std::min(options.min_splits, split.splits), split.splits);
  const SplitSeries series = by_blocks(split);
  if (!std::isfinite(series.factor())) {
    found.why_none = "no half of the blocks of time has a mean with a covariance";
    return found;
  }
  found.blocks = split.blocks, found.splits = split.splits;
  found.factor = series.factor(), found.low = series.factorLow(), found.high = series.factorHigh();
  found.p = series.pValue();
  return found;
}

/// Puts the comparison into a mean with a covariance: as a field if there was a test, as a note if the errors depend on
/// each other or there are too many rows. `inflate`: multiplies the covariance by the factor, where it is above one, in
/// place of the note.
inline void setTimeBlocks(MeanSummary& mean, TimeBlocks found, bool inflate) {
  if (!found.tested()) {
    if (found.too_many) mean.notes.push_back(found.why_none);
    return;
  }
  found.applied = inflate;
  if (inflate) mean.covariance *= found.inflation();
  if (found.dependent() && !inflate) mean.notes.push_back(found.verdict().text);
  mean.time_blocks = std::move(found);
}

}  // namespace liestat
