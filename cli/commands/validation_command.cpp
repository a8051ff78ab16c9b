#include <cli/commands/validation_command.hpp>

#include <formats/output_file.hpp>

#include <cstdio>

namespace liestat::cli {

using experiments::trials_of_run;

void RunOptions::declare(const Command& command, const std::string& usual) {
  command.option("--trials", trials, "Trials a row (default " + usual + ")")
      .range(std::size_t{1}, std::size_t{100000000});
  command.option("--seed", seed, "Seed; the same seed gives the same bits on any number of threads");
  command.option("--threads", threads, "Threads (default: all)").range(0, 4096);
  command.option("--json", json, "Write the rows to a JSON file ('-': standard output)");
  command.option("--report", report, "Write a page with plots into this directory");
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
  if (endedBeforeTrials()) return exit_interrupted;
  // Whoever asks for JSON on standard output wants nothing else there.
  if (options.json != "-") printLines(view.text());
  if (!options.json.empty()) writeJson(options.json, view.json(invocation.command_line, options.seed));
  if (!options.report.empty()) view.writePage(options.report, invocation.command_line);
  return exitCode(!view.judgement || view.judgement->passed());
}

}  // namespace liestat::cli
