#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/two_view_rules.hpp>

#include <fmt/format.h>

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

ValidationView viewOf(const std::vector<TwoViewRuleRow>& rows) {
  ValidationTable rules{.title = "Rules of choice over the same trials, all models estimated",
                        .headers = rule_headers,
                        .page_title = "",
                        .page_caption = "Shares of right choices over all motions, and of the motion with the fewest."};
  Plot plot{.name = "rules", .caption = "Shares of right choices of each rule and motion.", .columns = 3};
  for (const TwoViewRuleRow& row : rows) {
    rules.rows.push_back(cells(row));
    plot.panels.push_back(panelOf(row));
  }
  ValidationView view{.title = "Rules by which a model of two-view motion is chosen",
                      .introduction = "",
                      .fields = [&rows](JsonObject& object) { object("rules", rows); },
                      .tables = {std::move(rules)}};
  if (rows.empty()) return view;
  view.verdict = verdictOf(rows);
  view.page = [&rows, table = view.tables[0], plot](Report& report) {
    report.table(table.headers, table.rows, *table.page_caption);
    std::vector<std::vector<std::string>> motions;
    for (std::size_t k = 0; k < default_two_view_motions.size(); ++k) {
      motions.push_back({fmt::format("{}", k + 1), nameOf(default_two_view_motions[k]),
                         fmt::format("{}", rows.front().trials[k]), number(100 * rows.front().share(k))});
    }
    report.table({"number", "motion", "trials", "right by default, %"}, motions);
    report.plot(plot);
  };
  return view;
}

}  // namespace liestat::cli
