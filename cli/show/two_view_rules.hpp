#pragma once

#include <report/json.hpp>
#include <experiments/two_view_rules.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The rules with their shares of right choices, for the terminal.
std::string formatTwoViewRules(const std::vector<experiments::TwoViewRuleRow>& rows);

/// One rule as JSON.
JsonObject toJson(const experiments::TwoViewRuleRow& row);

/// The page with its plots.
void writeTwoViewRulesReport(const std::string& directory, const std::string& command_line,
                             const std::vector<experiments::TwoViewRuleRow>& rows);

}  // namespace liestat::cli
