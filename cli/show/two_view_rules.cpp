#include <cli/show/two_view_rules.hpp>

#include <cli/show/table.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;

std::string formatTwoViewRules(const std::vector<TwoViewRuleRow>& rows) {
  Table table({"rule", "right %", "least %", "of motion"});
  for (const TwoViewRuleRow& row : rows) {
    const std::size_t worst = row.worst();
    const double least = static_cast<double>(row.right[worst]) / static_cast<double>(row.trials);
    table.row({row.rule, fmt::format("{:.1f}", 100 * row.average()), fmt::format("{:.1f}", 100 * least),
               nameOf(default_two_view_motions[worst])});
  }
  return "\nRules of choice over the same trials, all models estimated\n" + table.str();
}

JsonObject toJson(const TwoViewRuleRow& row) {
  JsonObject o, right;
  for (std::size_t k = 0; k < row.right.size(); ++k) {
    right.set(nameOf(default_two_view_motions[k]), static_cast<double>(row.right[k]) / static_cast<double>(row.trials));
  }
  o.set("rule", row.rule).set("trials", row.trials).set("average", row.average());
  return o.set("right", right);
}

}  // namespace liestat::cli
