// The program, run with arguments.
#pragma once

#include <string>
#include <vector>

#include <cli/words.hpp>
#include <report/run_program.hpp>
#include <support/temporary_directory.hpp>

namespace liestat::cli {

struct ProgramOutput {
  int exit_code = -1;
  std::string output, error;
};

/// Runs the built program; its standard output is kept in full.
inline ProgramOutput run(const std::vector<std::string>& words) {
  const TemporaryDirectory directory;
  std::vector<std::string> command{"sh", "-c", "\"$0\" \"$@\" > '" + (directory / "out") + "'", LIESTAT_PROGRAM};
  command.insert(command.end(), words.begin(), words.end());
  const ProgramResult result = runProgram(command, ".");
  return {result.status, contentOf(directory / "out"), result.errors};
}

}  // namespace liestat::cli
