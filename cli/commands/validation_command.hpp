#pragma once

// The common part of the commands `validate means`, `validate propagation` and the like: lists of names on the command
// line, options of a run, a progress bar, rows in JSON, the exit code.

#include <formats/output_file.hpp>
#include <cli/commands/commands.hpp>
#include <report/json.hpp>
#include <cli/show/progress.hpp>
#include <cli/show/validation.hpp>
#include <experiments/interruption.hpp>
#include <experiments/judged_report.hpp>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <functional>
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

/// The result of run(progress), with a bar on the terminal while it runs; progress(done, all) takes amounts of work.
template <class Run>
auto withProgressBar(const std::string& label, const Run& run) {
  // The bar counts in thousandths, as the amount of work is known only inside.
  Progress bar(label, 1000);
  const std::function<void(std::uint64_t, std::uint64_t)> progress = [&bar](std::uint64_t done, std::uint64_t all) {
    const std::uint64_t now = all == 0 ? 1000 : 1000 * done / all;
    if (now > bar.done()) bar.advance(now - bar.done());
  };
  return run(progress);
}

/// The same for the trials of a validation, which an interrupt stops: run() returns what was computed.
template <class Run>
auto runTrials(const std::string& label, const Run& run) {
  const StopOnInterrupt watch;
  return withProgressBar(label, run);
}

/// The exit code of a validation.
inline int exitCode(bool passed) {
  if (experiments::trials_of_run.incomplete()) return exit_interrupted;
  return passed ? exit_fine : exit_validation_failed;
}

/// The places where the rows go besides the terminal; empty: none.
struct ValidationOutput {
  std::string json, report;
};

/// Declares what every validation takes: its size, its seed, its threads, and where the rows go. `size` says what the
/// default is.
inline void addRunOptions(const Command& command, const std::string& size, std::size_t& trials, std::uint64_t& seed,
                          int& threads, ValidationOutput& output) {
  command.option("--trials", trials, "Trials a row (default " + size + ")")
      .range(std::size_t{1}, std::size_t{100000000});
  command.option("--seed", seed, "Seed; the same seed gives the same bits on any number of threads");
  command.option("--threads", threads, "Threads (default: all)").range(0, 4096);
  command.option("--json", output.json, "Write the rows to a JSON file ('-': standard output)");
  command.option("--report", output.report, "Write a page with plots into this directory");
}

/// Further rows that a run judges, which format() shows: their fields in JSON and their tally.
struct FurtherRows {
  std::string key;
  std::vector<JsonObject> rows;
  experiments::Tally tally;
};

/// Shows rows as format(rows) on the terminal, each as toJson(row) in a JSON file and as a page by writeReport; returns
/// the exit code of those that were judged, further ones counted.
template <class Row, class Format, class ToJson, class WriteReport>
int publish(const ValidationOutput& output, const Invocation& invocation, std::uint64_t seed, double false_alarm,
            const std::vector<Row>& rows, const Format& format, const ToJson& toJson, const WriteReport& writeReport,
            const FurtherRows& further = {}) {
  if (endedBeforeTrials()) return exit_interrupted;
  const bool passed = (experiments::tally(rows) + further.tally).passed();
  // Whoever asks for JSON on standard output wants nothing else there.
  if (output.json != "-") printLines(format(rows));
  if (!output.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line, seed);
    std::vector<JsonObject> list;
    for (const Row& row : rows) list.push_back(toJson(row));
    object.set("false_alarm", false_alarm);
    setVerdict(object, passed).set("rows", list);
    if (!further.key.empty()) object.set(further.key, further.rows);
    writeJson(output.json, object);
  }
  if (!output.report.empty()) writeReport(output.report, invocation.command_line, rows);
  return exitCode(passed);
}

}  // namespace liestat::cli
