#pragma once

#include <functional>
#include <string>

namespace CLI {
class App;
}

namespace liestat::cli {

/// What the program's exit code says.
enum ExitCode : int {
  exit_fine = 0,
  exit_validation_failed = 1,
  exit_bad_input = 2,    ///< bad usage or bad input
  exit_not_trusted = 3,  ///< the estimate exists but is not to be trusted
};

/// What one run of the program is to do. Each command has a function `addNameCommand(CLI::App&, Invocation&)` in its
/// own source that declares its subcommand, and sets `run` when that was asked for.
struct Invocation {
  std::string command_line;  ///< as one could type it again
  std::function<int()> run;  ///< does the work and returns the exit code; may throw InputError
};

/// A subcommand of `parent`. CLI::App::add_subcommand makes every unit that calls it compile all of CLI11 (its classes
/// are inline and have virtual functions): four seconds each.
CLI::App* addCommand(CLI::App& parent, const std::string& name, const std::string& description);

void addMeanCommand(CLI::App& app, Invocation& invocation);
void addPreintegrateCommand(CLI::App& app, Invocation& invocation);
void addSimulateViCommand(CLI::App& simulate, Invocation& invocation);
void addValidateMeansCommand(CLI::App& validate, Invocation& invocation);
void addValidatePreintegrationCommand(CLI::App& validate, Invocation& invocation);
void addValidatePropagationCommand(CLI::App& validate, Invocation& invocation);
void addValidateSplitCommand(CLI::App& validate, Invocation& invocation);
void addValidateViInitCommand(CLI::App& validate, Invocation& invocation);
void addViInitCommand(CLI::App& app, Invocation& invocation);

}  // namespace liestat::cli
