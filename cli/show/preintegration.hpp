// The view of `liestat preintegrate`: motions between two times, their noise, and how far they are from a truth.
#pragma once

#include <cli/io/imu_file.hpp>
#include <cli/show/json.hpp>
#include <fusion/imu/preintegrate.hpp>

#include <Eigen/Core>

#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// One interval, and how far it is from the truth where that is known.
struct PreintegratedWindow {
  double begin = 0;  ///< s
  RecordingResult<double> result;
  ImuBias<double> bias = {};  ///< that was taken off the readings
  /// Where the readings fail, s: the reading that is at fault, and the one before it.
  std::optional<double> fault_end = {}, fault_begin = {};
  std::optional<Eigen::Matrix<double, 9, 1>> error;  ///< position, rotation, velocity
  double squared_distance = 0;                       ///< the error's, under the covariance
};

/// The largest standard deviations of an increment over so many seconds.
struct IncrementDeviations {
  double duration = 0, rotation = 0, velocity = 0, position = 0;  ///< s, rad, m/s, m
};
/// Standard deviations of a motion with noise.
IncrementDeviations deviationsOf(const Preintegration<double>& motion);

struct PreintegrationResult {
  std::vector<PreintegratedWindow> windows;
  bool with_noise = false;  ///< the sensor's noise is known, so there are covariances
  bool with_truth = false;  ///< there is a truth to compare with
};

/// A table, one line per window, and below it the medians of the errors where the truth is known.
std::string formatPreintegration(const PreintegrationResult& result);

/// The readings that were preintegrated, for the page.
struct PreintegratedReadings {
  const ImuFile& imu;
  std::string source;         ///< the file
  double begin = 0, end = 0;  ///< s
  double largest_gap = 0;     ///< s, that is accepted
  ImuNoise<double> noise = {};
  std::vector<IncrementDeviations> growth = {};  ///< from the beginning of the first window with a result
  double growth_begin = 0;                       ///< s
};

/// The page with its plots.
void writePreintegrationReport(const std::string& directory, const std::string& command_line,
                               const PreintegrationResult& result, const PreintegratedReadings& readings);

/// The status of a window in words.
std::string statusOf(const Fault& fault);

/// The lines of formatPreintegration() below the table: where readings fail, and the errors against the truth.
std::string preintegrationRemarks(const PreintegrationResult& result);

/// The columns and rows of its table.
std::vector<std::string> preintegrationHeaders(const PreintegrationResult& result);
std::vector<std::vector<std::string>> preintegrationRows(const PreintegrationResult& result);

/// The fields of `--json`.
void setPreintegration(JsonObject& object, const PreintegrationResult& result);

}  // namespace liestat::cli
