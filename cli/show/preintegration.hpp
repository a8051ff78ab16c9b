// The view of `liestat preintegrate`: motions between two times, their noise, and how far they are from a truth.
#pragma once

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
  /// Where the readings fail, s: the reading that is at fault, and the one before it.
  std::optional<double> fault_end = {}, fault_begin = {};
  std::optional<Eigen::Matrix<double, 9, 1>> error;  ///< position, rotation, velocity
  double squared_distance = 0;                       ///< the error's, under the covariance
};

struct PreintegrationResult {
  std::vector<PreintegratedWindow> windows;
  bool with_noise = false;  ///< the sensor's noise is known, so there are covariances
  bool with_truth = false;  ///< there is a truth to compare with
};

/// A table, one line per window, and below it the medians of the errors where the truth is known.
std::string formatPreintegration(const PreintegrationResult& result);

/// The fields of `--json`.
void setPreintegration(JsonObject& object, const PreintegrationResult& result);

}  // namespace liestat::cli
