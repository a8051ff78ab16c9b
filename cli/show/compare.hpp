#pragma once

#include <stats/compare_groups_types.hpp>

#include <string>
#include <vector>

namespace liestat::cli {

/// The comparison that `liestat compare` shows.
struct ComparisonOutput {
  std::string feature;
  std::vector<std::string> files;
  GroupComparison comparison;
};
template <class V>
void describe(V& v, const ComparisonOutput& output) {
  v("feature", output.feature)("files", output.files);
  describe(v, output.comparison);
}

/// Verdict, tests, groups and pairs, for the terminal.
std::string formatComparison(const ComparisonOutput& output);

/// The same as a page in a directory.
void writeComparisonReport(const std::string& directory, const std::string& command_line,
                           const ComparisonOutput& output);

}  // namespace liestat::cli
