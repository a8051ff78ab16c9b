#pragma once

#include <report/json.hpp>
#include <experiments/vi_init_validation.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The tables of `liestat validate vi-init` for the terminal, the verdict last.
std::string formatViInitTables(const std::vector<experiments::ViInitRow>& rows);

/// A row in JSON.
JsonObject toJson(const experiments::ViInitRow& row);

/// The page with its plots.
void writeViInitReport(const std::string& directory, const std::string& command_line,
                       const std::vector<experiments::ViInitRow>& rows);

}  // namespace liestat::cli
