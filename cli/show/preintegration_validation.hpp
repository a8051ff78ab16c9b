#pragma once

#include <report/json.hpp>
#include <experiments/preintegration_validation.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The table of `liestat validate preintegration` for the terminal, the verdict last.
std::string formatPreintegrationTable(const std::vector<experiments::PreintegrationRow>& rows);

/// A row in JSON.
JsonObject toJson(const experiments::PreintegrationRow& row);

/// The page with its plots.
void writePreintegrationReport(const std::string& directory, const std::string& command_line,
                               const std::vector<experiments::PreintegrationRow>& rows);

}  // namespace liestat::cli
