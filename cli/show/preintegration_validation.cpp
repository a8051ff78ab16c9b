#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/preintegration_validation.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace liestat::cli {

using namespace experiments;

namespace {

/// The page: plots over the windows, and a table.
void drawPage(Report& report, const std::vector<PreintegrationRow>& rows) {
  // A panel for each noise; what is checked, as a curve over the windows.
  const auto panels = [&](const std::string& quantity, double expected, const auto& value) {
    std::vector<Panel> list;
    for (const PreintegrationRow& row : rows) {
      const std::string title = fmt::format("{}, noise {:g}", quantity, row.noise);
      auto panel = std::find_if(list.begin(), list.end(), [&](const Panel& p) { return p.title == title; });
      if (panel == list.end()) {
        list.push_back({.title = title,
                        .x = {.label = "window, s", .logarithmic = true},
                        .y = {.label = quantity},
                        .references = {{.at = expected}}});
        panel = list.end() - 1;
      }
      if (panel->series.empty() || panel->series.back().name != name(row.check)) {
        panel->series.push_back({.name = name(row.check), .style = Style::linespoints});
      }
      panel->series.back().x.push_back(row.window);
      panel->series.back().y.push_back(value(row));
    }
    return list;
  };
  report.plot({.name = "index",
               .caption = "Validation index over its expectation, 1 expected (dotted).",
               .panels = panels("index / k", 1, [](const PreintegrationRow& row) { return row.relativeIndex(); }),
               .columns = 3});
  report.plot(
      {.name = "coverage",
       .caption = "Fraction of truths inside the 95 % region (dotted).",
       .panels = panels("covered", 0.95, [](const PreintegrationRow& row) { return row.report.coverage[2].observed; }),
       .columns = 3});
  std::vector<std::vector<std::string>> table;
  for (const PreintegrationRow& row : rows) {
    table.push_back({name(row.check), number(row.window), number(row.noise), fmt::format("{}", row.report.trials),
                     number(row.report.index), number(row.report.index_se, 2), number(row.report.law.mean()),
                     number(row.report.ks_p_value, 2), number(100 * row.report.coverage[2].observed),
                     verdictCell(row.passed)});
  }
  report.table({"check", "window s", "noise", "trials", "index", "SE", "expected", "K-S p", "95 % covers", "verdict"},
               table);
}

}  // namespace

ValidationView viewOf(const std::vector<PreintegrationRow>& rows) {
  ValidationTable table{
      .headers = {"check", "window s", "noise", "k", "index", "SE", "index/k", "K-S p", "95 % covers", "verdict"},
      .width = 110};
  for (const PreintegrationRow& row : rows) {
    const ValidationReport& r = row.report;
    table.rows.push_back({name(row.check), number(row.window), number(row.noise), fmt::format("{}", r.dof),
                          number(r.index), number(r.index_se, 2), fmt::format("{:.3f}", row.relativeIndex()),
                          number(r.ks_p_value, 2), fmt::format("{:.1f}", 100 * r.coverage[2].observed),
                          verdictCell(row.passed)});
  }
  return {.title = "Preintegration: is the covariance true?",
          .introduction =
              "Each trial makes a motion, readings of it with noise and walking biases, and takes the squared "
              "Mahalanobis distance of the true increment under the covariance. If that is true, the distances follow "
              "a chi-square law.",
          .judgement = judgementOf(rows),
          .fields = [&rows](JsonObject& object) { object("rows", rows); },
          .head = "Squared Mahalanobis distances of true increments; noise in multiples of an ADIS16448's\n\n",
          .tables = {std::move(table)},
          .page = [&rows](Report& report) { drawPage(report, rows); }};
}

}  // namespace liestat::cli
