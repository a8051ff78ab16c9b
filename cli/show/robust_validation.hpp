#pragma once

#include <report/json.hpp>
#include <experiments/robust_validation.hpp>

#include <string>

namespace liestat::cli {

/// The tables of `liestat validate robust` for the terminal, the verdict last.
std::string formatRobustTables(const experiments::RobustValidationResult& result);

/// A row in JSON, and a row of thresholds.
JsonObject toJson(const experiments::RobustRow& row);
JsonObject toJson(const experiments::ThresholdRow& row);

/// The page with its plots.
void writeRobustReport(const std::string& directory, const std::string& command_line,
                       const experiments::RobustValidationResult& result);

}  // namespace liestat::cli
