#pragma once

#include <cli/mean_analysis.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace liestat::cli {

/// Pennec 1998, section 5.2, on real data: the measures are split in two, each half has its mean with a covariance, and
/// the squared distance of both means under the sum of both covariances should be that of the law. Splits at random do
/// not see errors that successive measures share, splits by blocks of time do.

struct SplitOptions {
  std::size_t splits = 200;
  std::size_t blocks = 10;  ///< even; half of them make a half
  std::uint64_t seed = 1;
  int threads = 0;
};

/// Many splits of one kind.
struct SplitSeries {
  std::vector<double> distances;  ///< squared, as χ² of the same rank; NaN where an estimate failed
  double index = 0;               ///< their mean
  double dof = 0;                 ///< what is expected of it
  /// The index times this over `dof` follows χ² of so many degrees of freedom: the splits share their measures, so they
  /// tell no more than the blocks (or measures) that were dealt out.
  double effective_dof = 0;
  std::size_t failures = 0;

  double factor() const { return index / dof; }
  double standardError() const;  ///< of the index, if the covariances are true
  double pValue() const;         ///< of so large an index
  /// Ends of the confidence interval of the factor.
  double factorLow(double confidence = 0.95) const;
  double factorHigh(double confidence = 0.95) const;
};

/// Rows dealt out to two halves.
struct Halves {
  std::vector<std::size_t> first, second;
};

/// What is compared; the halves of a split are made when they are needed, as many measures have many halves.
struct SplitPlan {
  std::size_t splits = 0;
  std::function<Halves(std::size_t split, bool by_blocks)> deal;
  Halves in_time;
  std::function<double(double)> equivalentChiSquared;  ///< from the law of the squared distance
  std::function<void()> advance;                       ///< after each split, on any thread
};

/// A half of the measures.
struct HalfMean {
  std::size_t n = 0;
  FeatureValue mean = {};
  Eigen::MatrixXd covariance = {};
};

/// What splitMeasures returns.
struct SplitResult {
  std::size_t n = 0;
  SplitSeries random, by_blocks;
  HalfMean first, second;  ///< in time
  HalfMean merged;         ///< both fused
  double squared_distance = 0;
  double p_value = 0;
  std::string law;  ///< chi2 or hotelling
};

/// The fewest measures that can be split.
std::size_t fewestMeasures(const Measures& measures, const SplitOptions& options);

/// All splits of measures of which there are enough. The order of the rows, or their times, is the order in time.
/// `advance` is called twice a split, on any thread.
SplitResult splitMeasures(
    const Measures& measures, const SplitOptions& options, const std::function<void()>& advance = [] {});

/// Several objects measured at the same times: the indices averaged, their degrees of freedom added.
SplitSeries pooled(const std::vector<SplitSeries>& series);

/// A split fails when the blocks' index is too large by chance with less than this probability.
inline constexpr double split_false_alarm = 1e-5;

}  // namespace liestat::cli
