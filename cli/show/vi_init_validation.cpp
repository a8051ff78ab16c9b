#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/vi_init_validation.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

using Check = ViInitCheck;
using Quantity = ViInitQuantity;
using Group = ViInitGroup;

/// The factors of the densities of gyroscope and accelerometer in the calibration's rows.
std::string inWords(ViInitEstimator estimator) {
  std::string text = name(estimator).substr(std::string_view("noise_").size());
  std::replace(text.begin(), text.end(), '_', ',');
  return text;
}

/// The subject of a check, in a line.
const char* subjectOf(ViInitCheck check) {
  constexpr const char* names[] = {
      "Refinement under its covariance, biases drawn from their priors: index (degrees of freedom)",
      "Refinement under its covariance, biases that also walk: index (degrees of freedom)",
      "Closed form under its covariance, image noise alone: index (degrees of freedom)",
      "Closed form with the sensor's noise, biases known: errors, median / 95 %",
      "A gyroscope's bias of 0.05 rad/s: errors, median / 95 %",
      "Densities that are g and a times the given ones: how often 95 % intervals of the calibration hold that",
      "At rest, and slow among features 2 to 8 m away: told right, that it moves, and the covariance at rest",
      "40 % of the tracks drift by 8 px an image: errors, median / 95 %"};
  return names[static_cast<std::size_t>(check)];
}

std::string windowOf(const Group& g) {
  const ViInitWindow& w = g.first().window;
  return fmt::format("{:g} s, {}, {}", w.seconds, w.images, w.features);
}
std::string index(const ViInitRow* row) { return row == nullptr ? "" : fmt::format("{:.2f}", row->report->index); }
std::string ratio(const ViInitRow* row) { return row == nullptr ? "" : fmt::format("{:.3f}", row->value); }
std::string covered(const ViInitRow* row) {
  return row == nullptr ? "" : fmt::format("{:.1f}", 100 * row->report->coverage[2].observed);
}
std::string both(double median, double p95) { return number(median, 2) + " / " + number(p95, 2); }
std::string errors(const ViInitRow* row) { return row == nullptr ? "" : both(row->median, row->p95); }

bool isOfRefinement(Check check) { return check == Check::consistency || check == Check::walk; }
bool hasDistances(Check check) { return isOfRefinement(check) || check == Check::closed_form; }

/// A column of what one quantity of a window is.
Column<Group> columnOf(const char* heading, std::string (*cell)(const ViInitRow*), Quantity quantity) {
  return {heading, [=](const Group& g) { return cell(g.of(quantity)); }};
}
std::string verdictOf(const Group& g) { return verdictCell(g.passed()); }
std::string estimatorOf(const Group& g) { return name(g.first().estimator); }

Columns<Group> distanceColumns(Check check) {
  const bool refined = isOfRefinement(check), walks = check == Check::walk;
  Columns<Group> columns{{"T, n, N", windowOf}};
  if (refined && !walks) columns.push_back(columnOf("V (3)", index, Quantity::nees_v));
  columns.push_back(columnOf("V,G (5)", index, Quantity::nees_v_g));
  columns.push_back(columnOf(refined ? "all (11)" : "with bias (8)", index, Quantity::nees_all));
  if (refined) columns.push_back(columnOf("last (9)", index, Quantity::nees_last_state));
  if (walks) columns.push_back(columnOf("last, G, biases (17)", index, Quantity::nees_at_last));
  if (refined) columns.push_back(columnOf("start (15)", index, Quantity::nees_filter_start));
  columns.push_back(columnOf("χ²/dof", ratio, Quantity::chi2_per_dof));
  columns.push_back(columnOf("95 %", covered, Quantity::nees_v_g));
  columns.push_back({"lost", [](const Group& g) { return g.of(Quantity::nees_v_g)->failures; }});
  columns.push_back({"verdict", verdictOf});
  return columns;
}

/// The errors of a refinement stand below its distances.
Table errorsTable(const std::vector<Group>& list) {
  const Check check = list.front().first().check;
  std::vector<std::string> headers{"estimator", "T, n, N", "speed m/s", "gravity deg", "scale %"};
  if (check == Check::gyroscope_bias) headers[2] = "bias rad/s";
  if (check == Check::consistency) headers.push_back("of features");
  if (check == Check::drift) headers.push_back("selection");
  Table table(headers);
  for (const Group& g : list) {
    const Quantity leading = check == Check::gyroscope_bias ? Quantity::bias : Quantity::speed;
    std::vector<std::string> cells{name(g.first().estimator), windowOf(g), errors(g.of(leading)),
                                   errors(g.of(Quantity::gravity)), errors(g.of(Quantity::scale))};
    if (check == Check::consistency) cells.push_back(errors(g.of(Quantity::scale_of_features)));
    if (check == Check::drift) cells.push_back(ratio(g.of(Quantity::selection)));
    table.row(cells);
    // The reference figures, beside the first estimator of a window.
    const auto noted = [&](Quantity quantity) {
      const ViInitRow* row = g.of(quantity);
      if (row == nullptr || !row->promise || !std::isfinite(row->promise->note_median)) return std::string();
      return std::isfinite(row->promise->note_p95) ? both(row->promise->note_median, row->promise->note_p95)
                                                   : number(row->promise->note_median, 2);
    };
    const std::vector<std::string> note{"  (prototype)", "", noted(leading), noted(Quantity::gravity),
                                        noted(Quantity::scale)};
    if (std::any_of(note.begin() + 2, note.end(), [](const std::string& s) { return !s.empty(); })) table.row(note);
  }
  return table;
}

/// The check at rest: windows that were told right, and the covariance.
const Columns<Group> rest_columns{{"", estimatorOf},
                                  {"T, n, N", windowOf},
                                  columnOf("told right", ratio, Quantity::told),
                                  columnOf("moves", ratio, Quantity::moving),
                                  columnOf("gravity, biases (8)", index, Quantity::nees_at_rest),
                                  columnOf("start (15)", index, Quantity::nees_filter_start),
                                  columnOf("95 %", covered, Quantity::nees_at_rest),
                                  {"verdict", verdictOf}};
/// How often intervals held the factors.
const Columns<Group> noise_columns{{"factors g, a", [](const Group& g) { return inWords(g.first().estimator); }},
                                   {"T, n, N", windowOf},
                                   {"recordings", [](const Group& g) { return g.first().trials; }},
                                   columnOf("gyroscope's", ratio, Quantity::gyroscope_interval),
                                   columnOf("accelerometer's", ratio, Quantity::accelerometer_interval),
                                   columnOf("of both", ratio, Quantity::common_interval),
                                   {"verdict", verdictOf}};

std::string viInitTables(const std::vector<ViInitRow>& rows) {
  std::string text;
  for (const Check check : all_vi_init_checks) {
    const std::vector<Group> list = groups(rows, check);
    if (list.empty()) continue;
    if (text.empty()) {
      text = fmt::format("{} windows a row, of T seconds, n images and N features\n\n", list.front().first().trials);
    }
    text += fmt::format("{}\n\n", subjectOf(check));
    if (hasDistances(check)) text += Table(tableOf(distanceColumns(check), list)).str() + "\n";
    if (check == Check::rest) {
      text += Table(tableOf(rest_columns, list)).str() + "\n";
    } else if (check == Check::noise) {
      text += Table(tableOf(noise_columns, list)).str() + "\n";
    } else if (check != Check::closed_form && check != Check::walk) {
      text += errorsTable(list).str() + "\n";
    }
  }
  // The verdict brings its own empty line.
  if (!text.empty()) text.pop_back();
  return text;
}

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

/// The page: plots of indices and errors over the windows, and a table for each check.
void drawPage(Report& report, const std::vector<ViInitRow>& rows) {
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
    report.section(subjectOf(check));
    std::vector<std::vector<std::string>> table;
    for (const Group& g : list) {
      for (const ViInitRow* row : g.rows) {
        const bool law = row->report.has_value(), error = std::isfinite(row->median);
        table.push_back({name(row->estimator), windowOf(g), name(row->quantity), fmt::format("{}", row->trials),
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
}

}  // namespace

ValidationView viewOf(const std::vector<ViInitRow>& rows) {
  return {.title = "Visual-inertial initialisation: are its covariances true, and how good is it?",
          .introduction =
              "Each trial draws a scene, what a camera and an inertial sensor measure of it, and solves the window. If "
              "a covariance is true, the squared Mahalanobis distances of the truth under it follow a chi-square law "
              "with k degrees of freedom, and their mean, the index, is k.",
          .judgement = judgementOf(rows),
          .fields = [&rows](JsonObject& object) { object("rows", rows); },
          .head = viInitTables(rows),
          .page = [&rows](Report& report) { drawPage(report, rows); }};
}

}  // namespace liestat::cli
