#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/estimator_validation.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace liestat::cli {
using namespace experiments;
namespace {

using Cells = std::vector<std::string>;
using Rows = std::vector<EstimatorRow>;

/// A number where there is one.
std::string orNothing(double value, int digits = 4) { return std::isnan(value) ? "" : number(value, digits); }

const Cells criterion_headers{"experiment", "sigma", "r", "mean", "SE", "note", "K-S p", "iterations", "verdict"};
Cells criterionCells(const EstimatorRow& row) {
  const ValidationReport& r = row.report;
  return {name(row.experiment),     number(row.sigma),
          fmt::format("{}", r.dof), number(r.index),
          number(r.index_se, 2),    orNothing(row.note_index),
          number(r.ks_p_value, 2),  row.has_iterations ? fmt::format("{:.1f}", r.mean_iterations) : "",
          verdictCell(row.passed)};
}

const Cells parameter_headers{"experiment", "sigma", "k", "index", "SE", "note", "95 % covers", "note", "verdict"};
Cells parameterCells(const EstimatorRow& row) {
  const ValidationReport& r = row.report;
  return {name(row.experiment),
          number(row.sigma),
          fmt::format("{}", r.dof),
          number(r.index),
          number(r.index_se, 2),
          orNothing(row.note_index),
          fmt::format("{:.1f}", 100 * r.coverage[2].observed),
          orNothing(100 * row.note_coverage),
          verdictCell(row.passed)};
}

const Cells point_headers{"quantity", "k", "index", "SE", "95 % covers", "covariance off, %", "verdict"};
Cells pointCells(const EstimatorRow& row) {
  const ValidationReport& r = row.report;
  return {name(row.quantity),
          fmt::format("{}", r.dof),
          number(r.index),
          number(r.index_se, 2),
          fmt::format("{:.1f}", 100 * r.coverage[2].observed),
          orNothing(100 * row.covariance_deviation, 2),
          verdictCell(row.passed)};
}

/// A table: the rows of some quantities.
ValidationTable tableOf(const Rows& rows, std::vector<EstimatorQuantity> quantities, const Cells& headers,
                        Cells (*cells)(const EstimatorRow&), const char* title, const char* caption) {
  ValidationTable table{.title = title, .caption = caption, .headers = headers};
  Plot histograms{.name = "histograms_" + std::to_string(static_cast<int>(quantities.front())),
                  .caption = "Distances of the trials with the density that they should have.",
                  .columns = 4};
  for (const EstimatorRow& row : rows) {
    if (std::find(quantities.begin(), quantities.end(), row.quantity) == quantities.end()) continue;
    table.rows.push_back(cells(row));
    histograms.panels.push_back(
        histogramPanel(row, fmt::format("{}, sigma {:g}, {}", name(row.experiment), row.sigma, name(row.quantity))));
  }
  table.plots = {std::move(histograms)};
  return table;
}

}  // namespace

ValidationView viewOf(const Rows& rows) {
  using Quantity = EstimatorQuantity;
  return {
      .title = "Constrained estimation: do minimum, covariance and corrections follow their laws?",
      .introduction =
          "Each trial draws measurements with noise and estimates a parameter from them under implicit equations and "
          "constraints. To first order in the noise the minimum 2 L2 follows a chi-square law with the residual "
          "degrees of freedom, and the squared Mahalanobis distance of the truth one with as many as there are free "
          "parameters. Rows without a verdict are of a noise at which curvature counts; a prototype's figures stand "
          "beside them.",
      .judgement = judgementOf(rows),
      .fields = [&rows](JsonObject& object) { object("rows", rows); },
      .tables = {tableOf(rows, {Quantity::criterion}, criterion_headers, criterionCells, "2 L2, the minimum",
                         "Its mean is to be the number r of degrees of freedom."),
                 tableOf(rows, {Quantity::parameter}, parameter_headers, parameterCells,
                         "Squared Mahalanobis distance of the true parameter", "Its mean, the index, is to be k."),
                 tableOf(rows, {Quantity::correction, Quantity::corrected_point}, point_headers, pointCells,
                         "Corrected measurements: a conic through 12 points",
                         "Squared correction over its expectation; squared distance of the true point.")}};
}

}  // namespace liestat::cli
