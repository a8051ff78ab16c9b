#pragma once

#include <report/json.hpp>
#include <experiments/two_view_pairs.hpp>

#include <string>

namespace liestat::cli {

/// The tables of `liestat validate two-view --pairs` for the terminal, the verdict last.
std::string formatTwoViewPairs(const experiments::TwoViewPairsResult& result);

/// All rows, after the fields of the envelope.
JsonObject toJson(const experiments::TwoViewPairsResult& result, JsonObject envelope);

/// The page.
void writeTwoViewPairsReport(const std::string& directory, const std::string& command_line,
                             const experiments::TwoViewPairsResult& result);

}  // namespace liestat::cli
