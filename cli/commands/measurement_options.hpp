#pragma once

#include <cli/commands/command_line.hpp>
#include <cli/commands/measurements.hpp>

#include <functional>
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
  /// Reads a text some thousand rows at a time, which go to take() and are forgotten; a text that cannot be mapped
  /// (a pipe, a compressed one) is read as read() does. Throws InputError and OptionError.
  void readInChunks(const std::string& command, const std::function<void(const Measurements& rows)>& take) const;
  /// True if readInChunks() takes no more memory for a larger file.
  bool hasChunks() const;

 private:
  ReadingOptions howToRead() const;
};

}  // namespace liestat::cli
