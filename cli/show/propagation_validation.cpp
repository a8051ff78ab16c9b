#include <cli/show/propagation_validation.hpp>

#include <report/table.hpp>
#include <cli/show/validation.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <optional>

namespace liestat::cli {

using namespace experiments;

std::string formatPropagationTables(const std::vector<PropagationRow>& rows) {
  std::string text;
  for (const Propagated feature : all_propagated) {
    std::vector<PropagationMethod> methods;
    for (const PropagationMethod& method : propagation_methods) {
      if (!rowsOf(rows, feature, method).empty()) methods.push_back(method);
    }
    if (methods.empty()) continue;
    std::vector<std::string> headers{"spread"};
    for (const PropagationMethod& method : methods) headers.push_back(label(method));
    Table index(headers), coverage(headers);
    const auto levels = rowsOf(rows, feature, methods.front());
    for (std::size_t s = 0; s < levels.size(); ++s) {
      std::vector<std::string> index_cells{number(levels[s]->experiment.spread)}, coverage_cells = index_cells;
      for (const PropagationMethod& method : methods) {
        const PropagationRow& row = *rowsOf(rows, feature, method)[s];
        const char* mark = row.passed.value_or(true) ? "" : " !";
        index_cells.push_back(std::isfinite(row.relativeIndex()) ? fmt::format("{:.3f}{}", row.relativeIndex(), mark)
                                                                 : "n/a");
        coverage_cells.push_back(fmt::format("{:.1f}", 100 * row.report.coverage[2].observed));
      }
      index.row(index_cells);
      coverage.row(coverage_cells);
    }
    Table summary({"operation", "k", "consistent up to", "promised up to"});
    for (const PropagationMethod& method : methods) {
      const std::optional<double> consistent = consistentUpTo(rows, feature, method);
      summary.row({label(method), fmt::format("{}", degreesOfFreedom(feature, method.operation)),
                   consistent ? number(*consistent) : "-", number(propagationPromise(feature, method).spread)});
    }
    text += fmt::format(
        "\n{}\n\nValidation index over k, 1 expected; spread: largest sd of the inputs, rad and m\n{}"
        "\nTruth inside the 95 % region, %\n{}"
        "\nSpread up to which the index is within {:.0f} %, and up to which it is judged\n{}",
        name(feature), index.str(), coverage.str(), 100 * consistent_deviation, summary.str());
  }

  for (const PropagationRow& row : rows) {
    if (row.passed.value_or(true)) continue;
    text += fmt::format("\nFAILED {} {} spread {:.3g}: {}", name(row.experiment.feature), label(row.method),
                        row.experiment.spread, reason(row.verdict));
  }
  const Tally count = tally(rows);
  if (count.failed > 0) text += "\n";
  return text + "\n" + verdictLines(count, "in the promised domain");
}

JsonObject toJson(const PropagationRow& row) {
  const ValidationReport& r = row.report;
  JsonObject o;
  o.set("feature", name(row.experiment.feature)).set("operation", name(row.method.operation));
  o.set("order", row.method.fourth_order ? 4 : 1).set("in_domain", row.promise.has_value());
  o.set("spread", row.experiment.spread);
  setStatistics(o, r);
  o.set("tail", row.tail).set("failures", r.failures).set("passed", row.passed);
  return o;
}

}  // namespace liestat::cli
