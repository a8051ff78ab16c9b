#pragma once

// The common part of the commands `validate means`, `validate propagation` and the like: lists of names on the command
// line, options of a run, a progress bar, the places where a view goes, the exit code.

#include <cli/commands/commands.hpp>
#include <cli/show/progress.hpp>
#include <cli/show/validation.hpp>
#include <experiments/cell_run.hpp>

#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// The names of all members of a list of enumerators.
template <class List>
std::vector<std::string> names(const List& list) {
  std::vector<std::string> all;
  for (const auto value : list) all.push_back(name(value));
  return all;
}

/// The enumerators with the given names, each once and in their own order; all of them for none. The command
/// line has checked the names.
template <class List>
auto chosen(const List& list, const std::vector<std::string>& wanted) {
  std::vector<typename List::value_type> values;
  for (const auto value : list) {
    if (wanted.empty() || std::find(wanted.begin(), wanted.end(), name(value)) != wanted.end()) values.push_back(value);
  }
  return values;
}

/// The result of run(progress), with a bar on the terminal while it runs.
template <class Run>
auto withProgressBar(const std::string& label, const Run& run) {
  // The bar counts in thousandths, as the amount of work is known only inside.
  Progress bar(label, 1000);
  const experiments::RunProgress progress = [&bar](std::uint64_t done, std::uint64_t all) {
    const std::uint64_t now = all == 0 ? 1000 : 1000 * done / all;
    if (now > bar.done()) bar.advance(now - bar.done());
  };
  return run(progress);
}

/// The same for trials, which an interrupt stops: run() returns what was computed.
template <class Run>
auto runTrials(const std::string& label, const Run& run) {
  const StopOnInterrupt watch;
  return withProgressBar(label, run);
}

/// Options of a run that is shared by machines, or that may be killed (experiments/run_state.hpp).
struct SharedRun {
  std::string part, state, checkpoint;
  std::vector<std::string> merge;

  void declare(const Command& command);
  /// Begins the run: takes results over from files. Threads and the places where the results go, `results`, do not
  /// belong to it. Throws OptionError and InputError.
  void begin(const Invocation& invocation, const std::vector<std::string>& results) const;
  /// Ends it: writes its file, and of a part says so and gives the exit code. Throws InputError.
  std::optional<int> end() const;
};

/// Options that every validation takes.
struct RunOptions {
  std::size_t trials = 0;  ///< 0: the default
  std::uint64_t seed = 1;
  int threads = 0;
  bool full = false;
  std::string json, report;  ///< the places where the rows go besides the terminal; empty: none
  SharedRun shared = {};

  /// The size of a run with so many trials by default, and with --full.
  experiments::RunSize size(std::size_t usual, std::size_t all) const {
    return {trials != 0 ? trials : full ? all : usual, seed, threads};
  }
  experiments::RunSize size(std::size_t usual) const { return size(usual, usual); }

  /// Declares them, but for --full; `usual` says in words how many trials are the default.
  void declare(const Command& command, const std::string& usual);
  /// Before the first trial, see SharedRun.
  void begin(const Invocation& invocation) const { shared.begin(invocation, {json, report}); }
};

/// Says so, and is true, if an interrupt came before any trial ended, so that there is nothing to show.
bool endedBeforeTrials();

/// The exit code of a validation.
int exitCode(bool passed);

/// Shows a view on the terminal, in the JSON file and as the page that were asked for, unless the run is a part of one;
/// returns the exit code.
int publish(const RunOptions& options, const Invocation& invocation, const ValidationView& view);

/// The options of a validation whose trials one function runs.
template <class Validation>
struct ValidationOptions {
  Validation validation;
  std::vector<std::string> names, more_names;  ///< experiments or methods that are wanted; none: all
  RunOptions run;
};
/// Declares the option of a comma list of such names.
template <class List>
void declareNames(const Command& command, const std::string& option, std::vector<std::string>& wanted, const List& all,
                  const std::string& description) {
  command.option(option, wanted, description).list().oneOf(names(all));
}
/// The work of such a command: runs compute(options, progress) with a bar and publishes its view.
template <class Options, class Compute, class View>
void runValidation(const Command& command, const std::shared_ptr<Options>& options, const std::string& label,
                   const Compute& compute, const View& viewOf) {
  command.run([=](const Invocation& invocation) {
    options->run.begin(invocation);
    const auto result = runTrials(label, [&](const auto& progress) { return compute(*options, progress); });
    return publish(options->run, invocation, viewOf(result));
  });
}

}  // namespace liestat::cli
