#pragma once

#include <cli/commands/measurements.hpp>
#include <stats/split_validation_types.hpp>

#include <cstddef>
#include <functional>

namespace liestat::cli {

/// Options of splitMeasurements(): the splits, and the number of threads (0: all).
struct SplitSettings {
  SplitOptions split;
  int threads = 0;
};

/// The fewest measurements that can be split.
std::size_t fewestMeasurements(const Measurements& measurements, const SplitOptions& options);

/// All splits of measurements of which there are enough. The order of the rows, or their times, is the order in time.
/// `advance` is called twice a split, on any thread. An interrupt (experiments/interruption.hpp) leaves the first splits of
/// each kind, perhaps none.
SplitSummary splitMeasurements(
    const Measurements& measurements, const SplitSettings& settings, const std::function<void()>& advance = [] {});

}  // namespace liestat::cli
