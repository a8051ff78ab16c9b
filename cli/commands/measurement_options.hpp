#pragma once

#include <cli/commands/command_line.hpp>
#include <cli/commands/measurements.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The file of features and the options about it that several commands share.
struct MeasurementInput {
  std::string file;
  std::string format = "auto";
  double norm_tolerance = ReadingOptions{}.norm_tolerance;
  bool degrees = false, radians = false, ignore_unknown = false;
  std::vector<std::string> columns;
  MeasurementOptions options;

  /// Declares FILE, --format, --columns, --ignore-unknown, --feature, --criterion, --covariance-at, --likelihood,
  /// --degrees, --radians and --norm-tolerance.
  void declare(const Command& app, bool file_required);
  /// Reads the file; throws InputError. `command` begins the messages about options.
  Measurements read(const std::string& command) const;
};

}  // namespace liestat::cli
