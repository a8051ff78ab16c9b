#pragma once

#include <report/json.hpp>
#include <experiments/motion_validation.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The tables of `liestat validate motion` for the terminal, the verdict last.
std::string formatMotionTables(const std::vector<experiments::MotionRow>& rows);

/// A row in JSON.
JsonObject toJson(const experiments::MotionRow& row);

/// The page with its plots.
void writeMotionReport(const std::string& directory, const std::string& command_line,
                       const std::vector<experiments::MotionRow>& rows);

}  // namespace liestat::cli
