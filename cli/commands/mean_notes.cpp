// Apart from the estimators, which cost a compiler enough without the laws of Boost.
#include <cli/commands/mean_analysis.hpp>
#include <cli/commands/split.hpp>

#include <stats/covariance.hpp>
#include <stats/laws.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace liestat::cli {
namespace {

/// Splits cost several means each: with many rows there are fewer of them, and beyond these rows none.
constexpr std::size_t most_rows = 200000, split_rows = 2000000, fewest_splits = 20;

}  // namespace

void compareBlocks(MeanAnalysis& analysis, const Measurements& measurements, const AnalysisOptions& options) {
  const std::size_t n = measurements.size();
  if (measurements.file.times.empty() || analysis.covariance.size() == 0) return;
  if (n > most_rows) {
    analysis.notes.emplace_back(
        "the rows have times, but are too many for a comparison of blocks of time: see liestat validate split");
    return;
  }
  SplitSettings how;
  how.threads = options.threads;
  how.split.splits = std::clamp(split_rows / n, fewest_splits, how.split.splits);
  if (n < fewestMeasurements(measurements, how.split)) return;
  const SplitSeries series = splitMeasurements(measurements, how).by_blocks;
  if (!std::isfinite(series.factor())) return;
  TimeBlocks& found = analysis.time_blocks.emplace();
  found = {.blocks = how.split.blocks,
           .splits = how.split.splits,
           .factor = series.factor(),
           .low = series.factorLow(),
           .high = series.factorHigh(),
           .p = series.pValue(),
           .applied = options.inflate};
  if (options.inflate) analysis.covariance *= std::max(1.0, found.factor);
  if (found.p < dependent_rows && !options.inflate) {
    analysis.notes.push_back(fmt::format(
        "the errors of successive rows are not independent: halves made of {} blocks of time differ by {:.3g} times "
        "the "
        "expected squared distance (95 %: {:.3g} to {:.3g}), so the standard deviations of the mean are about {:.2g} "
        "times too small (--inflate multiplies them)",
        found.blocks, found.factor, found.low, found.high, std::sqrt(found.factor)));
  }
}

void explain(MeanAnalysis& analysis, std::size_t measurements) {
  if (const std::size_t without = measurements - std::min(analysis.n, measurements); without > 0) {
    analysis.notes.push_back(fmt::format("{} {} no weight beside the others and {} not counted", without,
                                         without == 1 ? "measurement has" : "measurements have",
                                         without == 1 ? "is" : "are"));
  }
  // Weights hide differences in the dispersion, so the distances themselves are looked at.
  const bool all_equal = std::all_of(analysis.largest.begin(), analysis.largest.end(),
                                     [](const LargestResidual& r) { return !(r.value > 1e-14); });
  if (analysis.n == 1) {
    analysis.notes.emplace_back("one measurement is its own mean");
  } else if (all_equal) {
    analysis.notes.emplace_back(analysis.covariance_from == "residuals"
                                    ? "all measurements are equal: a covariance from the residuals is zero, which says "
                                      "nothing about an error that they share"
                                    : "all measurements are equal");
  } else if (analysis.covariance_from == "residuals" && isSingular(analysis.covariance)) {
    analysis.notes.emplace_back(
        "the measurements do not vary in every direction: the covariance from the residuals is singular");
  }
  if (analysis.fit_dof > 0) {
    analysis.fit_p = chiSquaredSurvival(analysis.fit, analysis.fit_dof);
    if (analysis.fit_p < 1e-3) {
      analysis.notes.push_back(
          fmt::format("the measurements scatter more than their covariances say: {:.4g} times the expected squared "
                      "distance (p = {:.2g})",
                      analysis.fit / analysis.fit_dof, analysis.fit_p));
    }
  }
}

}  // namespace liestat::cli
