#pragma once

#include <cli/show/json.hpp>
#include <experiments/means_validation.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The tables of `liestat validate means` for the terminal, the verdict last.
std::string formatMeansTables(const std::vector<experiments::MeansRow>& rows);

/// A row in JSON.
JsonObject toJson(const experiments::MeansRow& row);

/// The page with its plots.
void writeMeansReport(const std::string& directory, const std::string& command_line,
                      const std::vector<experiments::MeansRow>& rows);

}  // namespace liestat::cli
