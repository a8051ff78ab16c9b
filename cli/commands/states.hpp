#pragma once

#include <cli/commands/measurement_options.hpp>
#include <formats/npy.hpp>

#include <string>

namespace liestat::cli {

/// The options of `liestat mean` about states.
struct StateOptions {
  std::string state, after;   ///< files, written and read; empty: none
  double largest_weight = 1;  ///< of a state of moments
};

/// Adds the features of a file to a state, moments or, after a pass before, sums at its mean, writes it and shows its
/// mean. Returns the exit code. Throws InputError and OptionError.
int writeState(const MeasurementInput& input, const StateOptions& options, const std::string& json,
               const Invocation& invocation);

/// The mean of a file that is larger than the memory it may take, in as many passes as that takes: an array is left
/// where it is, the rows of a text go to a file in TMPDIR. Throws InputError for features without states.
int streamMean(const MeasurementInput& input, const std::string& json, const Invocation& invocation);

/// `liestat merge`, as the commands of cli/commands/commands.hpp.
void addMergeCommand(const CommandList& program);

}  // namespace liestat::cli
