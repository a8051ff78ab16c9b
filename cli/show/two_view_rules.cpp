#include <cli/show/two_view_rules.hpp>

#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/validation.hpp>
#include <experiments/interruption.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

const std::vector<std::string> rule_headers{"rule", "right %", "least %", "of motion"};

std::vector<std::string> cells(const TwoViewRuleRow& row) {
  const std::size_t worst = row.worst();
  return {row.rule, fmt::format("{:.1f}", 100 * row.average()), fmt::format("{:.1f}", 100 * row.share(worst)),
          nameOf(default_two_view_motions[worst])};
}

/// Shares of right choices, a bar of each motion.
Panel panelOf(const TwoViewRuleRow& row) {
  Panel panel{.title = row.rule,
              .x = {.label = "motion, numbered as in the table"},
              .y = {.label = "right choices, %", .low = 0.0, .high = 100.0}};
  Series bars{.style = Style::boxes};
  for (std::size_t k = 0; k < row.trials.size(); ++k) {
    if (row.trials[k] == 0) continue;
    bars.x.push_back(static_cast<double>(k + 1)), bars.y.push_back(100 * row.share(k)), bars.width.push_back(0.8);
  }
  panel.x.low = 0.5, panel.x.high = static_cast<double>(row.trials.size()) + 0.5;
  panel.series = {bars};
  return panel;
}

}  // namespace

std::string formatTwoViewRules(const std::vector<TwoViewRuleRow>& rows) {
  Table table(rule_headers);
  for (const TwoViewRuleRow& row : rows) table.row(cells(row));
  const std::string text = "\nRules of choice over the same trials, all models estimated\n" + table.str();
  return trials_of_run.incomplete() ? text + "\n" + interruptedLines("trials", "") : text;
}

JsonObject toJson(const TwoViewRuleRow& row) {
  JsonObject o, right;
  for (std::size_t k = 0; k < row.right.size(); ++k) right.set(nameOf(default_two_view_motions[k]), row.share(k));
  o.set("rule", row.rule).set("trials", *std::max_element(row.trials.begin(), row.trials.end()));
  return o.set("average", row.average()).set("right", right);
}

void writeTwoViewRulesReport(const std::string& directory, const std::string& command_line,
                             const std::vector<TwoViewRuleRow>& rows) {
  Report report(directory, "Rules by which a model of two-view motion is chosen");
  if (trials_of_run.incomplete()) {
    showVerdict(report, formatTwoViewRules(rows));
  } else {
    const auto best = std::max_element(rows.begin(), rows.end(), [](const TwoViewRuleRow& a, const TwoViewRuleRow& b) {
      return a.average() < b.average();
    });
    const double right = rows.front().average();
    report.verdict(true, fmt::format("The default rule chooses the right model in {:.1f} % of the trials{}. Nothing is "
                                     "promised of the rules.",
                                     100 * right,
                                     best->average() > right
                                         ? fmt::format(", and '{}' in {:.1f} %", best->rule, 100 * best->average())
                                         : ", and no other rule in more"));
  }
  report.code(command_line);
  std::vector<std::vector<std::string>> rules, motions;
  for (const TwoViewRuleRow& row : rows) rules.push_back(cells(row));
  report.table(rule_headers, rules, "Shares of right choices over all motions, and of the motion with the fewest.");
  for (std::size_t k = 0; k < default_two_view_motions.size(); ++k) {
    motions.push_back({fmt::format("{}", k + 1), nameOf(default_two_view_motions[k]),
                       fmt::format("{}", rows.front().trials[k]), number(100 * rows.front().share(k))});
  }
  report.table({"number", "motion", "trials", "right by default, %"}, motions);
  Plot plot{.name = "rules", .caption = "Shares of right choices of each rule and motion.", .columns = 3};
  for (const TwoViewRuleRow& row : rows) plot.panels.push_back(panelOf(row));
  report.plot(plot);
  report.write();
}

}  // namespace liestat::cli
