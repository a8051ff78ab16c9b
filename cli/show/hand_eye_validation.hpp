#pragma once

#include <report/json.hpp>
#include <experiments/hand_eye_validation.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The tables of the experiments, and the verdict.
std::string formatHandEyeTables(const std::vector<experiments::HandEyeRow>& rows);

/// A row in JSON.
JsonObject toJson(const experiments::HandEyeRow& row);

/// Writes a page with the tables and the histograms of the squared distances into a directory.
void writeHandEyeReport(const std::string& directory, const std::string& command_line,
                        const std::vector<experiments::HandEyeRow>& rows);

}  // namespace liestat::cli
