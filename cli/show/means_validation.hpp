#pragma once

#include <report/json.hpp>
#include <experiments/means_validation.hpp>
#include <experiments/means_verdicts.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The tables of `liestat validate means` for the terminal, the verdict last.
std::string formatMeansTables(const std::vector<experiments::MeansRow>& rows,
                              const std::vector<experiments::VerdictRow>& verdicts = {});

/// A row in JSON.
JsonObject toJson(const experiments::MeansRow& row);
JsonObject toJson(const experiments::VerdictRow& row);

/// The page with its plots.
void writeMeansReport(const std::string& directory, const std::string& command_line,
                      const std::vector<experiments::MeansRow>& rows,
                      const std::vector<experiments::VerdictRow>& verdicts = {});

}  // namespace liestat::cli
