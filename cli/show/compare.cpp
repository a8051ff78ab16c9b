#include <cli/show/compare.hpp>

#include <formats/output_file.hpp>
#include <report/page.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <cmath>
#include <string>

namespace liestat::cli {
namespace {

TableRows testRows(const GroupComparison& found) {
  TableRows table{{"test", "statistic", "F degrees of freedom", "p"}};
  const auto add = [&](const char* what, const EqualityTest& test) {
    if (std::isnan(test.p)) return;
    const std::string dof =
        std::isnan(test.numerator_dof) ? "resampled" : number(test.numerator_dof) + ", " + number(test.denominator_dof);
    table.rows.push_back({what, number(test.statistic), dof, number(test.p, 2)});
  };
  add("equal means", found.means);
  add("the same, if dispersions are equal", found.means_if_alike);
  add("equal dispersions", found.dispersions);
  return table;
}

TableRows groupRows(const GroupComparison& found) {
  TableRows table{{"group", "n", "mean's offset from the pooled mean", "sd"}};
  for (const ComparedGroup& group : found.groups) {
    std::string offset, deviations;
    for (Eigen::Index i = 0; i < group.offset.size(); ++i) {
      offset += (i == 0 ? "" : " ") + number(group.offset[i], 3);
      deviations += (i == 0 ? "" : " ") + number(std::sqrt(group.dispersion(i, i)), 3);
    }
    table.rows.push_back({group.name, cell(group.n), offset, deviations});
  }
  return table;
}

TableRows pairRows(const GroupComparison& found) {
  TableRows table{{"pair", "difference of the means", "p", "family-wise"}};
  for (const ComparedPair& pair : found.pairs) {
    std::string difference;
    for (const double x : pair.difference) difference += (difference.empty() ? "" : " ") + number(x, 3);
    table.rows.push_back({found.groups[pair.first].name + ", " + found.groups[pair.second].name, difference,
                          number(pair.means.p, 2), number(pair.adjusted_p, 2)});
  }
  return table;
}

}  // namespace

std::string formatComparison(const ComparisonOutput& output) {
  const GroupComparison& found = output.comparison;
  // Groups that have no pooled mean are not listed.
  std::string text = found.groups.empty() ? "" : fmt::format("{} groups, ", found.groups.size());
  text += fmt::format("feature {}{}\n{}\n", output.feature, found.paired ? ", in pairs" : "", found.verdict().text);
  if (std::isnan(found.means.p)) return text;
  text += "\n" + Table(testRows(found)).str() + "\n" + Table(groupRows(found)).str();
  return found.pairs.size() > 1 || found.paired ? text + "\n" + Table(pairRows(found)).str() : text;
}

void writeComparisonReport(const std::string& directory, const std::string& command_line,
                           const ComparisonOutput& output) {
  Report report(directory, "Do the groups differ?");
  report.verdict(output.comparison.verdict());
  report.code(command_line);
  report.table(testRows(output.comparison));
  report.table(groupRows(output.comparison), "In the tangent space at the pooled mean: rad and m.");
  report.table(pairRows(output.comparison), "Family-wise p by Holm.");
  printLines("\n" + report.write() + "\n");
}

}  // namespace liestat::cli
