#pragma once

#include <report/json.hpp>
#include <experiments/estimator_validation.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The tables of `liestat validate estimator` for the terminal, the verdict last.
std::string formatEstimatorTables(const std::vector<experiments::EstimatorRow>& rows);

/// A row in JSON.
JsonObject toJson(const experiments::EstimatorRow& row);

/// The page with its plots.
void writeEstimatorReport(const std::string& directory, const std::string& command_line,
                          const std::vector<experiments::EstimatorRow>& rows);

}  // namespace liestat::cli
