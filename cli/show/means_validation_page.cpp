#include <cli/show/means_validation.hpp>
#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/validation.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace liestat::cli {
using namespace experiments;
namespace {

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

}  // namespace

void writeMeansReport(const std::string& directory, const std::string& command_line, const std::vector<MeansRow>& rows,
                      const std::vector<VerdictRow>& verdicts) {
  Report report(directory, "Means of geometric features: are their covariances true?");
  showVerdict(report, formatMeansTables(rows, verdicts));
  report.paragraph(
      "Each trial draws a feature, measures it n times with noise, estimates the mean and its covariance, and takes "
      "the "
      "squared Mahalanobis distance of the exact feature about the estimate. If the covariance is true these distances "
      "follow a chi-square law (known noise) or Hotelling's law (noise estimated from the residuals). The validation "
      "index is their mean. Experiments of Pennec, INRIA RR-3371 (1998), section 5.");
  report.code(command_line);

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
  report.write();
}

}  // namespace liestat::cli
