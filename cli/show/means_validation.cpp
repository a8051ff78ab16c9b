#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/means_validation.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <tuple>
#include <utility>

namespace liestat::cli {

using namespace experiments;

namespace {

std::string verdictTable(const std::vector<VerdictRow>& verdicts) {
  std::string text =
      "\nVerdicts of certifiedMean, % of the trials: ok, of these outside of the 95 % region (miss), on the wrong\n"
      "side (wrong); coverage of what is ok (cover) and of first-order covariances never withheld (plain)\n";
  Table table({"feature, law", "n", "ok", "ambig", "ill", "miss", "wrong", "cover", "plain", ""});
  for (const VerdictRow& row : verdicts) {
    const auto percent = [&](double rate) { return fmt::format("{:.1f}", 100 * rate); };
    table.row(
        {fmt::format("{} {} {:.3g}", name(row.cell.feature).substr(0, 13), name(row.cell.law), row.cell.parameter),
         fmt::format("{}", row.cell.n), percent(row.rate(row.ok)), percent(row.rate(row.ambiguous)),
         percent(row.rate(row.ill_defined)), percent(row.rate(row.outside)), percent(row.rate(row.wrong)),
         row.ok > 0 ? percent(row.coverage()) : "-", percent(1 - row.rate(row.plain_outside)),
         verdictCell(row.passed)});
  }
  return text + table.str();
}

std::string meansTables(const std::vector<MeansRow>& rows) {
  // One line of each table for a feature, spread, noise and n.
  using Key = std::tuple<Feature, double, Noise, std::size_t>;
  std::vector<Key> order;
  std::map<Key, std::map<std::size_t, const MeansRow*>> cells;
  for (const MeansRow& row : rows) {
    const Key key{row.experiment.feature, row.experiment.spread, row.experiment.noise, row.experiment.n};
    if (!cells.contains(key)) order.push_back(key);
    cells[key][methodIndex(row.method)] = &row;
  }
  const auto cell = [&](const Key& key, const Method& method) -> const MeansRow* {
    const auto& line = cells[key];
    const auto found = line.find(methodIndex(method));
    return found == line.end() ? nullptr : found->second;
  };
  const auto any = [&](const Method& method) {
    return std::any_of(rows.begin(), rows.end(),
                       [&](const MeansRow& row) { return methodIndex(row.method) == methodIndex(method); });
  };
  const auto mark = [](const MeansRow* row, double value) {
    if (row == nullptr) return std::string("-");
    if (!std::isfinite(value)) return std::string("n/a");
    return fmt::format("{:.2f}{}", value, !row->passed ? "" : *row->passed ? "" : " !");
  };

  std::string text;
  // The features in turn, so that no line is wider than a terminal.
  std::vector<std::pair<Feature, double>> groups;
  for (const Key& key : order) {
    const std::pair group{std::get<0>(key), std::get<1>(key)};
    if (std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
  }
  for (const auto& [feature, spread] : groups) {
    const int k = degreesOfFreedom(feature);
    text += fmt::format("\n{}, spread {:.3g}\n", name(feature), spread);

    Table known({"noise", "n", "LSQ print", "corr", "WLSQ print", "corr", "MAHA print", "corr", "K-S p"});
    Table residual({"noise", "n", "LSQ print", "corr", "K-S p", "WLSQ print", "corr", "K-S p"});
    Table accuracy({"noise", "n", "LSQ/MAHA rot", "trans", "WLSQ/MAHA rot", "trans", "it LSQ", "it MAHA"});
    for (const Key& key : order) {
      if (std::get<0>(key) != feature || std::get<1>(key) != spread) continue;
      const std::string noise = name(std::get<2>(key)), n = fmt::format("{}", std::get<3>(key));
      std::vector<std::string> known_cells{noise, n}, residual_cells{noise, n}, accuracy_cells{noise, n};
      for (const Criterion criterion : all_criteria) {
        for (const bool corrected : {false, true}) {
          const MeansRow* row = cell(key, {criterion, corrected, true});
          known_cells.push_back(mark(row, row ? row->report.index : 0));
        }
        if (criterion == Criterion::maha) break;
        for (const bool corrected : {false, true}) {
          const MeansRow* row = cell(key, {criterion, corrected, false});
          residual_cells.push_back(mark(row, row ? row->relativeIndex() : 0));
        }
        const MeansRow* row = cell(key, {criterion, true, false});
        residual_cells.push_back(row ? number(row->report.ks_p_value, 2) : "-");
        const MeansRow* exact = cell(key, {criterion, true, true});
        for (const ErrorRatio index : {log_ratio_rotation, log_ratio_translation}) {
          accuracy_cells.push_back(
              exact && std::isfinite(exact->ratio(index)) ? fmt::format("{:.3f}", exact->ratio(index)) : "-");
        }
      }
      const MeansRow* maha = cell(key, {Criterion::maha, true, true});
      const MeansRow* lsq = cell(key, {Criterion::lsq, true, true});
      const MeansRow* last = maha ? maha : lsq;
      known_cells.push_back(last ? number(last->report.ks_p_value, 2) : "-");
      accuracy_cells.push_back(lsq ? fmt::format("{:.1f}", lsq->report.mean_iterations) : "-");
      accuracy_cells.push_back(maha ? fmt::format("{:.1f}", maha->report.mean_iterations) : "-");
      known.row(known_cells);
      residual.row(residual_cells);
      accuracy.row(accuracy_cells);
    }
    text +=
        fmt::format("\nKnown noise: validation index, {} expected (printed | corrected formula; K-S of the last)\n{}",
                    k, known.str());
    if (any({Criterion::lsq, true, false}) || any({Criterion::wlsq, true, false})) {
      text +=
          fmt::format("\nNoise from residuals: index over the mean of Hotelling's law, 1 expected\n{}", residual.str());
    }
    if (any({Criterion::maha, true, true})) {
      text += fmt::format("\nErrors over MAHA's (geometric mean), iterations from the first measurement\n{}",
                          accuracy.str());
    }
  }
  return text;
}

/// One curve over n of a quantity of the rows of a method.
template <class Value>
Series curve(const std::vector<const MeansRow*>& rows, const Method& method, std::string title, const Value& value) {
  Series series{.name = std::move(title), .style = Style::linespoints};
  for (const MeansRow* row : rows) {
    if (methodIndex(row->method) != methodIndex(method)) continue;
    series.x.push_back(static_cast<double>(row->experiment.n));
    series.y.push_back(value(*row));
  }
  return series;
}

/// The same with bars.
template <class Value, class Bar>
Series curveWithBars(const std::vector<const MeansRow*>& rows, const Method& method, std::string title,
                     const Value& value, const Bar& bar) {
  Series series{.name = std::move(title), .style = Style::errorbars};
  for (const MeansRow* row : rows) {
    if (methodIndex(row->method) != methodIndex(method)) continue;
    const auto [low, high] = bar(*row);
    if (!std::isfinite(value(*row)) || !std::isfinite(low) || !std::isfinite(high)) continue;
    series.x.push_back(static_cast<double>(row->experiment.n));
    series.y.push_back(value(*row));
    series.low.push_back(low);
    series.high.push_back(high);
  }
  return series;
}

void addIfAny(std::vector<Series>& list, Series series) {
  if (!series.x.empty()) list.push_back(std::move(series));
}

/// The page: for each feature and spread plots and a table.
void drawPage(Report& report, const std::vector<MeansRow>& rows) {
  std::vector<std::pair<Feature, double>> groups;
  for (const MeansRow& row : rows) {
    const std::pair group{row.experiment.feature, row.experiment.spread};
    if (std::find(groups.begin(), groups.end(), group) == groups.end()) groups.push_back(group);
  }
  for (const auto& [feature, spread] : groups) {
    report.section(fmt::format("{}, spread {:.3g}", name(feature), spread));
    const double k = degreesOfFreedom(feature);
    for (const Noise noise : all_noises) {
      std::vector<const MeansRow*> cell;
      for (const MeansRow& row : rows) {
        if (row.experiment.feature == feature && row.experiment.spread == spread && row.experiment.noise == noise) {
          cell.push_back(&row);
        }
      }
      if (cell.empty()) continue;
      std::size_t largest = 0;
      for (const MeansRow* row : cell) largest = std::max(largest, row->experiment.n);

      const auto index = [](const MeansRow& row) { return row.report.index; };
      const auto index_bar = [](const MeansRow& row) {
        const double sd = std::sqrt(row.report.variance);
        return std::pair(std::max(0.0, row.report.index - sd), row.report.index + sd);
      };
      Plot plot{
          .name = fmt::format("{}_{}_{:.3g}", name(feature), name(noise), spread),
          .caption = fmt::format("{}, noise {}: top, known noise: index with the deviation of the distances (LSQ), "
                                 "index of all criteria, confidence of the K-S test; middle, noise from residuals; "
                                 "bottom, histograms at n = {}, errors over MAHA's, iterations.",
                                 name(feature), name(noise), largest),
          .columns = 3};
      const Axis n_axis{.label = "n"};

      Panel deviation{.title = "LSQ, known noise", .x = n_axis, .y = {.label = "index, deviation", .low = 0.0}};
      addIfAny(deviation.series, curveWithBars(cell, {Criterion::lsq, true, true}, "corrected", index, index_bar));
      deviation.references = {{.at = k}, {.at = k - std::sqrt(2 * k)}, {.at = k + std::sqrt(2 * k)}};

      Panel indices{.title = "known noise", .x = n_axis, .y = {.label = "index"}};
      Panel confidence{
          .title = "K-S confidence, known noise", .x = n_axis, .y = {.label = "p-value", .low = 0.0, .high = 1.0}};
      for (const Criterion criterion : all_criteria) {
        addIfAny(indices.series, curve(cell, {criterion, true, true}, name(criterion), index));
        addIfAny(confidence.series, curve(cell, {criterion, true, true}, name(criterion),
                                          [](const MeansRow& row) { return row.report.ks_p_value; }));
      }
      addIfAny(indices.series, curve(cell, {Criterion::lsq, false, true}, "lsq printed", index));
      indices.references = {{.at = k}};
      confidence.references = {{.at = 0.01}};

      Panel ratios{.title = "noise from residuals", .x = n_axis, .y = {.label = "index / Hotelling mean"}};
      Panel residual_confidence{
          .title = "K-S confidence, residuals", .x = n_axis, .y = {.label = "p-value", .low = 0.0, .high = 1.0}};
      for (const Criterion criterion : {Criterion::lsq, Criterion::wlsq}) {
        const auto ratio = [](const MeansRow& row) { return row.relativeIndex(); };
        const auto p_value = [](const MeansRow& row) { return row.report.ks_p_value; };
        addIfAny(ratios.series, curve(cell, {criterion, true, false}, name(criterion), ratio));
        addIfAny(ratios.series, curve(cell, {criterion, false, false}, name(criterion) + " printed", ratio));
        addIfAny(residual_confidence.series, curve(cell, {criterion, true, false}, name(criterion), p_value));
      }
      ratios.references = {{.at = 1}};
      residual_confidence.references = {{.at = 0.01}};

      Panel accuracy{.title = "errors over MAHA's", .x = n_axis, .y = {.label = "ratio"}};
      const ErrorRatio kind = feature == Feature::point ? log_ratio_translation : log_ratio_rotation;
      for (const Criterion criterion : {Criterion::lsq, Criterion::wlsq}) {
        addIfAny(
            accuracy.series,
            curveWithBars(
                cell, {criterion, true, true}, name(criterion), [&](const MeansRow& row) { return row.ratio(kind); },
                [&](const MeansRow& row) {
                  const double sd = row.logDeviation(kind);
                  return std::pair(row.ratio(kind) * std::exp(-sd), row.ratio(kind) * std::exp(sd));
                }));
      }
      accuracy.references = {{.at = 1}};
      Panel iterations{.title = "iterations", .x = n_axis, .y = {.label = "mean", .low = 0.0}};
      for (const Criterion criterion : all_criteria) {
        addIfAny(iterations.series, curve(cell, {criterion, true, true}, name(criterion),
                                          [](const MeansRow& row) { return row.report.mean_iterations; }));
      }
      std::vector<Panel> candidates{deviation, indices, confidence, ratios, residual_confidence};
      for (const Method& method : {Method{Criterion::lsq, true, true}, Method{Criterion::lsq, true, false}}) {
        for (const MeansRow* row : cell) {
          if (row->experiment.n == largest && methodIndex(row->method) == methodIndex(method) &&
              row->report.size() > 0) {
            candidates.push_back(histogramPanel(
                *row, fmt::format("LSQ, {}, n = {}", method.known_noise ? "known noise" : "residuals", largest)));
          }
        }
      }
      candidates.push_back(accuracy);
      candidates.push_back(iterations);
      for (Panel& panel : candidates) {
        if (!panel.series.empty()) plot.panels.push_back(std::move(panel));
      }
      report.plot(plot);
    }

    std::vector<std::vector<std::string>> table;
    for (const MeansRow& row : rows) {
      if (row.experiment.feature != feature || row.experiment.spread != spread) continue;
      table.push_back({name(row.experiment.noise), fmt::format("{}", row.experiment.n), name(row.method.criterion),
                       row.method.corrected ? "corrected" : "printed", row.method.known_noise ? "known" : "residuals",
                       fmt::format("{}", row.report.trials), number(row.report.index), number(row.report.index_se, 2),
                       number(row.report.law.mean()), number(row.report.ks_p_value, 2),
                       number(100 * row.report.coverage[2].observed, 4), fmt::format("{}", row.report.failures),
                       verdictCell(row.passed)});
    }
    report.table({"noise", "n", "criterion", "formula", "noise is", "trials", "index", "SE", "expected", "K-S p",
                  "95 % covers", "failures", "verdict"},
                 table);
  }
}

}  // namespace

ValidationView viewOf(const MeansValidationResult& result) {
  return {.title = "Means of geometric features: are their covariances true?",
          .introduction =
              "Each trial draws a feature, measures it n times with noise, estimates the mean and its covariance, and "
              "takes the squared Mahalanobis distance of the exact feature about the estimate. If the covariance is "
              "true these distances follow a chi-square law (known noise) or Hotelling's law (noise estimated from the "
              "residuals). The validation index is their mean. Experiments of Pennec, INRIA RR-3371 (1998), section 5.",
          .judgement = judgementOf(result),
          .fields = [&result](JsonObject& object) { object.fieldsOf(result); },
          .head = meansTables(result.rows) + (result.verdicts.empty() ? "" : verdictTable(result.verdicts)),
          .page = [&result](Report& report) { drawPage(report, result.rows); }};
}

}  // namespace liestat::cli
