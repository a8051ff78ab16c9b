// The view of `liestat preintegrate`: motions between two times, their noise, and how far they are from a truth.
#pragma once

#include <formats/imu.hpp>
#include <fusion/imu/recording_windows_types.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// A table, one line per window; below it where readings fail, the medians of the errors where the truth is known, and
/// the verdict.
std::string formatPreintegration(const RecordingWindows& result);

/// The readings that were preintegrated, for the page.
struct PreintegratedReadings {
  const ImuFile& imu;
  std::string source;         ///< the file
  double begin = 0, end = 0;  ///< s
  double largest_gap = 0;     ///< s, that is accepted
  ImuNoise<double> noise = {};
  std::vector<IncrementSigmas> growth = {};  ///< from the beginning of the first window with a result
  double growth_begin = 0;                   ///< s
};

/// The page with its plots.
void writePreintegrationReport(const std::string& directory, const std::string& command_line,
                               const RecordingWindows& result, const PreintegratedReadings& readings);

}  // namespace liestat::cli
