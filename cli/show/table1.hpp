#pragma once

#include <report/json.hpp>
#include <experiments/table1.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The table for the terminal, with the corrections below and the verdict last.
std::string formatTable1(const std::vector<experiments::Table1Row>& rows);

/// A case in JSON.
JsonObject toJson(const experiments::Table1Row& row);

/// A page with the same.
void writeTable1Report(const std::string& directory, const std::string& command_line,
                       const std::vector<experiments::Table1Row>& rows);

}  // namespace liestat::cli
