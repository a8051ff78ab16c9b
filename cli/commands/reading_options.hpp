// Options on the rows of files of features and trajectories: the same in every command that reads such files.
#pragma once

#include <cli/commands/command_line.hpp>
#include <formats/trajectory.hpp>

#include <string>

namespace liestat::cli {

/// Declares --columns, --ignore-unknown, --norm-tolerance and --largest-file.
void declareReading(const Command& command, ReadingOptions& reading);

/// Declares these, --cov-layout, --unmeasured-above, --time-unit and --duplicates.
void declareReading(const Command& command, TrajectoryOptions& reading, std::optional<DuplicateRule>& duplicates);

}  // namespace liestat::cli
