#pragma once

#include <report/json.hpp>
#include <experiments/two_view_validation.hpp>

#include <string>

namespace liestat::cli {

/// The tables of `liestat validate two-view` for the terminal, the verdict last.
std::string formatTwoViewTables(const experiments::TwoViewValidationResult& result);

/// A row in JSON, and a row of choices.
JsonObject toJson(const experiments::TwoViewRow& row);
JsonObject toJson(const experiments::TwoViewChoice& choice);

/// The page with its plots.
void writeTwoViewReport(const std::string& directory, const std::string& command_line,
                        const experiments::TwoViewValidationResult& result);

}  // namespace liestat::cli
