#include <cli/show/validation.hpp>
#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/vi_init_validation.hpp>
#include <cli/show/vi_init_validation_groups.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace liestat::cli {
using namespace experiments;
namespace {

using Check = ViInitCheck;
using Quantity = ViInitQuantity;
using Group = ViInitGroup;

/// A panel of curves over the windows' length, one for each estimator, of those windows that have 20 features and an
/// image every tenth of a second.
template <class Value>
Panel overWindows(const std::vector<ViInitRow>& rows, Check check, Quantity quantity, const std::string& title,
                  const std::string& label, const Value& value) {
  Panel panel{.title = title, .x = {.label = "window, s", .low = 0.5, .high = 4.5}, .y = {.label = label}};
  for (const ViInitRow& row : rows) {
    const auto steps = static_cast<double>(row.window.images - 1);
    if (row.check != check || row.quantity != quantity || row.window.features != 20 ||
        std::abs(steps / row.window.seconds - 10) > 0.1) {
      continue;
    }
    if (panel.series.empty() || panel.series.back().name != name(row.estimator)) {
      auto found = std::find_if(panel.series.begin(), panel.series.end(),
                                [&](const Series& s) { return s.name == name(row.estimator); });
      if (found == panel.series.end()) {
        panel.series.push_back({.name = name(row.estimator), .style = Style::linespoints});
      } else {
        std::rotate(found, found + 1, panel.series.end());
      }
    }
    panel.series.back().x.push_back(row.window.seconds);
    panel.series.back().y.push_back(value(row));
  }
  return panel;
}

/// The rows with distances of a check as points with bars of three standard errors, numbered.
Panel indexPanel(const std::vector<ViInitRow>& rows, Check check) {
  Panel panel{.title = check == Check::consistency ? "refinement" : "closed form, image noise alone",
              .x = {.label = "kind of window, in the table's order"},
              .y = {.label = "index / k"},
              .references = {{.at = 1}}};
  std::vector<Group> list = groups(rows, check);
  for (const Quantity quantity :
       {Quantity::nees_v, Quantity::nees_v_g, Quantity::nees_all, Quantity::nees_last_state}) {
    Series series{.name = name(quantity), .style = Style::errorbars};
    for (std::size_t i = 0; i < list.size(); ++i) {
      const ViInitRow* row = list[i].of(quantity);
      if (row == nullptr) continue;
      const double k = row->report->law.mean();
      // Side by side.
      series.x.push_back(static_cast<double>(i + 1) + 0.12 * (static_cast<double>(panel.series.size()) - 1.5));
      series.y.push_back(row->report->index / k);
      series.low.push_back((row->report->index - 3 * row->report->index_se) / k);
      series.high.push_back((row->report->index + 3 * row->report->index_se) / k);
    }
    if (!series.x.empty()) panel.series.push_back(series);
  }
  panel.x.low = 0.5;
  panel.x.high = static_cast<double>(list.size()) + 0.5;
  return panel;
}

Panel coveragePanel(const std::vector<ViInitRow>& rows, Check check) {
  Panel panel = indexPanel(rows, check);
  panel.y = {.label = "inside the 95 % region"};
  panel.references = {{.at = 0.95}};
  std::vector<Group> list = groups(rows, check);
  for (Series& series : panel.series) {
    std::size_t k = 0;
    for (const Group& g : list) {
      for (const ViInitRow* row : g.rows) {
        if (name(row->quantity) != series.name) continue;
        const Coverage& c = row->report->coverage[2];
        series.y[k] = c.observed;
        series.low[k] = c.observed - 3 * c.standard_error;
        series.high[k] = std::min(1., c.observed + 3 * c.standard_error);
        ++k;
      }
    }
  }
  return panel;
}

}  // namespace

void writeViInitReport(const std::string& directory, const std::string& command_line,
                       const std::vector<ViInitRow>& rows) {
  Report report(directory, "Visual-inertial initialisation: are its covariances true, and how good is it?");
  showVerdict(report, formatViInitTables(rows));
  report.paragraph(
      "Each trial draws a scene, what a camera and an inertial sensor measure of it, and solves the window. If a "
      "covariance is true, the squared Mahalanobis distances of the truth under it follow a chi-square law with k "
      "degrees of freedom, and their mean, the index, is k.");
  report.code(command_line);
  std::vector<Panel> distances;
  for (const Check check : {Check::consistency, Check::closed_form}) {
    if (groups(rows, check).empty()) continue;
    distances.push_back(indexPanel(rows, check));
    distances.push_back(coveragePanel(rows, check));
  }
  if (!distances.empty()) {
    report.plot({.name = "consistency",
                 .caption =
                     "Index over its expectation, and the fraction of truths in the 95 % region, both with three "
                     "standard errors; dotted, what is expected.",
                 .panels = distances});
  }
  std::vector<Panel> accuracy;
  for (const Quantity quantity : {Quantity::speed, Quantity::gravity, Quantity::scale}) {
    Panel panel = overWindows(rows, Check::accuracy, quantity, name(quantity), unit(quantity),
                              [](const ViInitRow& row) { return row.median; });
    Panel refined =
        overWindows(rows, Check::consistency, quantity, "", "", [](const ViInitRow& row) { return row.median; });
    panel.series.insert(panel.series.end(), refined.series.begin(), refined.series.end());
    const std::size_t medians = panel.series.size();
    for (const Check check : {Check::accuracy, Check::consistency}) {
      Panel high = overWindows(rows, check, quantity, "", "", [](const ViInitRow& row) { return row.p95; });
      panel.series.insert(panel.series.end(), high.series.begin(), high.series.end());
    }
    for (std::size_t i = medians; i < panel.series.size(); ++i) {
      panel.series[i].name += ", 95 %";
      panel.series[i].dashed = true;
    }
    for (std::size_t i = 0; i < panel.series.size(); ++i)
      panel.series[i].colour = i % std::max<std::size_t>(1, medians);
    panel.y.logarithmic = true;
    if (!panel.series.empty()) accuracy.push_back(panel);
  }
  if (!accuracy.empty()) {
    report.plot({.name = "errors",
                 .caption =
                     "Medians of the errors over the length of the window, and their 95 % quantiles (dashed). 20 "
                     "features, ten images a second. The refinement does not know the biases, the others do.",
                 .panels = accuracy,
                 .columns = 3});
  }
  for (const Check check : all_vi_init_checks) {
    const std::vector<Group> list = groups(rows, check);
    if (list.empty()) continue;
    report.section(describe(check));
    std::vector<std::vector<std::string>> table;
    for (const Group& g : list) {
      for (const ViInitRow* row : g.rows) {
        const bool law = row->report.has_value(), error = std::isfinite(row->median);
        table.push_back({name(row->estimator), g.window(), name(row->quantity), fmt::format("{}", row->trials),
                         fmt::format("{}", row->failures),
                         law                         ? number(row->report->index)
                         : std::isfinite(row->value) ? number(row->value)
                                                     : "",
                         law                            ? number(row->report->index_se, 2)
                         : std::isfinite(row->value_se) ? number(row->value_se, 2)
                                                        : "",
                         law ? number(row->report->law.mean()) : "", law ? number(row->report->ks_p_value, 2) : "",
                         law ? number(100 * row->report->coverage[2].observed) : "",
                         error ? number(row->median, 3) : "", error ? number(row->p95, 3) : "", unit(row->quantity),
                         verdictCell(row->passed)});
      }
    }
    report.table({"estimator", "T, images, features", "quantity", "trials", "lost", "index or value", "SE", "expected",
                  "K-S p", "95 % covers", "median", "95 %", "unit", "verdict"},
                 table);
  }
  report.write();
}

}  // namespace liestat::cli
