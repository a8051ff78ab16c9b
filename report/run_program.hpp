#pragma once

#include <string>
#include <vector>

namespace liestat {

/// The end of a program.
struct ProgramResult {
  bool found = false;  ///< false: it is not installed
  int status = -1;     ///< its exit code, 128 and more for a signal
  std::string errors;  ///< its standard error
};

/// Runs a program found by PATH in a directory and waits for it. No shell takes part. It reads nothing from standard
/// input.
ProgramResult runProgram(const std::vector<std::string>& arguments, const std::string& directory);

}  // namespace liestat
