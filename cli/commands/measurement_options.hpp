#pragma once

#include <cli/commands/command_line.hpp>
#include <cli/commands/measurements.hpp>

#include <string>

namespace liestat::cli {

/// The file of features and the options about it that several commands share.
struct MeasurementInput {
  std::string file;
  ReadingOptions reading;
  bool degrees = false, radians = false;
  MeasurementOptions options;

  /// Declares FILE, --format, the options of reading, --feature, --criterion, --covariance-at, --likelihood, --degrees and
  /// --radians.
  void declare(const Command& app, bool file_required);
  /// Reads the file; throws InputError. `command` begins the messages about options.
  Measurements read(const std::string& command) const;
};

}  // namespace liestat::cli
