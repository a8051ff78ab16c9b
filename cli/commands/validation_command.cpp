#include <cli/commands/validation_command.hpp>

#include <experiments/run_state.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/text.hpp>
#include <report/json.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstdio>

namespace liestat::cli {

using experiments::run_state;
using experiments::trials_of_run;

void RunOptions::declare(const Command& command, const std::string& usual) {
  command.option("--trials", trials, "Trials a row (default " + usual + ")")
      .range(std::size_t{1}, std::size_t{100000000});
  command.option("--seed", seed, "Seed; the same seed gives the same bits on any number of threads");
  command.option("--threads", threads, "Threads (default: all)").range(0, 4096);
  command.option("--json", json, "Write the rows to a JSON file ('-': standard output)");
  command.option("--report", report, "Write a page with plots into this directory");
  shared.declare(command);
}

void SharedRun::declare(const Command& command) {
  command.option("--part", part, "K/N: run only this part of the trials, and write their results to --state");
  command.option("--state", state, "The file of the part; what it has already is not run again");
  const Option merged =
      command.option("--merge", merge, "The files of all parts, with the same options: the report of the whole run");
  command.option("--checkpoint", checkpoint, "Keep the results in this file; a run that was killed goes on from there")
      .excludes("--part")
      .excludes("--state")
      .excludes(merged);
  merged.excludes("--part").excludes("--state");
}

void SharedRun::begin(const Invocation& invocation, const std::vector<std::string>& results) const {
  if (part.empty() != state.empty()) throw OptionError("--part", "is given together with --state");
  if (part.empty() && merge.empty() && checkpoint.empty()) return;
  // The options that decide the numbers.
  std::string run = std::string(programVersion());
  for (const std::string& option : invocation.options) {
    const std::string name = option.substr(0, option.find('='));
    const bool aside = name == "--threads" || name == "--json" || name == "--report" || name == "--part" ||
                       name == "--state" || name == "--merge" || name == "--checkpoint";
    if (!aside) run += " " + option;
  }
  if (!merge.empty()) return run_state.merge(run, merge);
  experiments::RunPart wanted;
  if (!part.empty()) {
    const std::size_t slash = part.find('/');
    double number = 0, count = 0;
    if (slash == part.npos || parseNumber(part.substr(0, slash), number) != NumberKind::finite ||
        parseNumber(part.substr(slash + 1), count) != NumberKind::finite || !(number >= 1 && number <= count) ||
        count > 1e6 || number != std::floor(number) || count != std::floor(count)) {
      throw OptionError("--part", fmt::format("'{}' is no part", printable(part)),
                        "K/N with whole numbers, K from 1 to N");
    }
    for (const std::string& place : results) {
      if (!place.empty()) throw OptionError("--part", "has no rows of its own: --json and --report go with --merge");
    }
    wanted = {static_cast<std::size_t>(number), static_cast<std::size_t>(count)};
  }
  run_state.keep(run, part.empty() ? checkpoint : state, wanted);
  if (run_state.taken_over() == 0) return;
  std::fputs(printableLines(fmt::format("liestat: {} has the results of {} tasks; the run goes on from there\n",
                                        run_state.file(), run_state.taken_over()))
                 .c_str(),
             stderr);
}

std::optional<int> SharedRun::end() const {
  if (!run_state.active()) return {};
  run_state.finish();
  if (part.empty()) return {};
  if (run_state.tasks() == 0) throw OptionError("--part", "there are no trials to be shared");
  printLines(fmt::format("part {}: {} of the run's {} tasks are in {}\n", part, run_state.done(), run_state.tasks(),
                         run_state.file()));
  return trials_of_run.stop ? exit_interrupted : exit_fine;
}

bool endedBeforeTrials() {
  if (!trials_of_run.incomplete() || trials_of_run.done > 0) return false;
  std::fputs("liestat: interrupted before the first trial ended: there is nothing to write\n", stderr);
  return true;
}

int exitCode(bool passed) {
  if (trials_of_run.incomplete()) return exit_interrupted;
  return passed ? exit_fine : exit_validation_failed;
}

int publish(const RunOptions& options, const Invocation& invocation, const ValidationView& view) {
  if (const std::optional<int> code = options.shared.end()) return *code;
  if (endedBeforeTrials()) return exit_interrupted;
  // Whoever asks for JSON on standard output wants nothing else there.
  if (options.json != "-") printLines(view.text());
  if (!options.json.empty()) writeJson(options.json, view.json(invocation.command_line, options.seed));
  if (!options.report.empty()) view.writePage(options.report, invocation.command_line);
  return exitCode(!view.judgement || view.judgement->passed());
}

}  // namespace liestat::cli
