#pragma once

#include <report/json.hpp>
#include <experiments/propagation_validation.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The tables of `liestat validate propagation` for the terminal, the verdict last.
std::string formatPropagationTables(const std::vector<experiments::PropagationRow>& rows);

/// A row in JSON.
JsonObject toJson(const experiments::PropagationRow& row);

/// The page with its plots.
void writePropagationReport(const std::string& directory, const std::string& command_line,
                            const std::vector<experiments::PropagationRow>& rows);

}  // namespace liestat::cli
