#pragma once

#include <formats/pose_pairs.hpp>
#include <report/json.hpp>
#include <fusion/hand_eye_types.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// Where the covariances of a file's poses come from.
enum class PoseNoise {
  columns,  ///< covariance columns of the file
  option,   ///< --sigma-a, --sigma-b
  assumed   ///< a default; its factor is found in the residuals
};

/// One of the files of `liestat hand-eye`.
struct HandEyeFile {
  std::string path;
  PoseNoise noise = PoseNoise::assumed;
  Eigen::Matrix<double, 6, 1> sigma;  ///< m, rad; where it does not come from columns
  bool inverted = false;
  std::size_t rows = 0, unmatched = 0;
};

/// The results and settings that `liestat hand-eye` shows.
struct HandEyeOutput {
  HandEyeFile a, b;
  std::vector<PoseRows> rows;
  bool by_time = false;
  double tolerance = 0, largest_gap = 0;  ///< s, where by time
  HandEyeOptions options;
  HandEyeResult result;
  std::optional<HandEyeHint> hint;
  std::vector<std::string> notes;  ///< on the files
};

/// The verdict, X and Y, the fit, wrong pairs, open directions and hints, for the terminal.
std::string formatHandEye(const HandEyeOutput& output);

/// Adds the fields of the calibration.
void setHandEye(JsonObject& object, const HandEyeOutput& output);

/// Writes a page with residuals, excitations and the covariance of X into a directory.
void writeHandEyeReport(const std::string& directory, const std::string& command_line, const HandEyeOutput& output);

}  // namespace liestat::cli
