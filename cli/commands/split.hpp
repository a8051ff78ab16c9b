#pragma once

#include <cli/commands/mean_analysis.hpp>
#include <stats/split_validation.hpp>

#include <cstddef>
#include <functional>
#include <string>

namespace liestat::cli {

/// Options of splitMeasurements(): the splits, and the number of threads (0: all).
struct SplitSettings {
  SplitOptions split;
  int threads = 0;
};

/// A half of the measurements.
struct HalfMean {
  std::size_t n = 0;
  FeatureValue mean = {};
  Eigen::MatrixXd covariance = {};  ///< empty if there is none
};

/// The result of splitMeasurements: a SplitValidation whatever the feature.
struct SplitResult {
  std::size_t n = 0;
  SplitSeries random, by_blocks;
  HalfMean first, second;  ///< in time
  HalfMean merged;         ///< both fused
  double squared_distance = 0;
  double p_value = 0;
  std::string law;  ///< chi2 or hotelling
};

/// The fewest measurements that can be split.
std::size_t fewestMeasurements(const Measurements& measurements, const SplitOptions& options);

/// All splits of measurements of which there are enough. The order of the rows, or their times, is the order in time.
/// `advance` is called twice a split, on any thread. An interrupt (experiments/interruption.hpp) leaves the first splits of
/// each kind, perhaps none.
SplitResult splitMeasurements(
    const Measurements& measurements, const SplitSettings& settings, const std::function<void()>& advance = [] {});

/// A split fails when the blocks' index is too large by chance with less than this probability.
inline constexpr double split_false_alarm = 1e-5;

}  // namespace liestat::cli
