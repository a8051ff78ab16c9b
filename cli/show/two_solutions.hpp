#pragma once

#include <report/json.hpp>
#include <experiments/two_solutions.hpp>

#include <cstdint>
#include <string>

namespace liestat::cli {

/// Both solutions in numbers, for the terminal.
std::string formatTwoSolutions(const experiments::TwoSolutions& found);

/// The scene and both solutions in JSON; `seed` is the one that the search began at.
JsonObject toJson(const experiments::TwoSolutions& found, const std::string& command_line, std::uint64_t seed);

/// A page with the figure.
void writeTwoSolutionsReport(const std::string& directory, const std::string& command_line,
                             const experiments::TwoSolutions& found);

}  // namespace liestat::cli
