#include <cli/show/estimator_validation.hpp>

#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/validation.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>

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

/// The rows of a table: those of one quantity, or of corrected measurements.
struct Part {
  std::string title, caption;
  Cells headers;
  Cells (*cells)(const EstimatorRow&);
  bool (*holds)(EstimatorQuantity);
};
const Part parts[] = {
    {"2 L2, the minimum", "Its mean is to be the number r of degrees of freedom.", criterion_headers, criterionCells,
     [](EstimatorQuantity q) { return q == EstimatorQuantity::criterion; }},
    {"Squared Mahalanobis distance of the true parameter", "Its mean, the index, is to be k.", parameter_headers,
     parameterCells, [](EstimatorQuantity q) { return q == EstimatorQuantity::parameter; }},
    {"Corrected measurements: a conic through 12 points",
     "Squared correction over its expectation; squared distance of the true point.", point_headers, pointCells,
     [](EstimatorQuantity q) {
       return q == EstimatorQuantity::correction || q == EstimatorQuantity::corrected_point;
     }}};

std::vector<Cells> cellsOf(const Part& part, const Rows& rows) {
  std::vector<Cells> list;
  for (const EstimatorRow& row : rows) {
    if (part.holds(row.quantity)) list.push_back(part.cells(row));
  }
  return list;
}

}  // namespace

std::string formatEstimatorTables(const Rows& rows) {
  std::string text;
  for (const Part& part : parts) {
    const std::vector<Cells> cells = cellsOf(part, rows);
    if (cells.empty()) continue;
    Table table(part.headers);
    for (const Cells& row : cells) table.row(row);
    text += fmt::format("\n{}\n{}\n{}", part.title, part.caption, table.str());
  }
  std::string reasons;
  for (const EstimatorRow& row : rows) {
    if (row.passed.value_or(true)) continue;
    reasons += fmt::format("FAILED {} {}: {}\n", name(row.experiment), name(row.quantity), reason(row.verdict));
  }
  return fmt::format("{}\n{}{}", text, reasons, verdictLines(tally(rows), "where first order holds"));
}

JsonObject toJson(const EstimatorRow& row) {
  JsonObject o;
  o.set("experiment", name(row.experiment)).set("quantity", name(row.quantity)).set("sigma", row.sigma);
  o.set("in_domain", row.promise.has_value());
  setStatistics(o, row.report);
  o.set("tail", row.tail).set("failures", row.report.failures);
  const double none = std::nan("");
  o.set("iterations", row.has_iterations ? row.report.mean_iterations : none);
  o.set("max_iterations", row.has_iterations ? row.report.max_iterations : none);
  o.set("note_index", row.note_index).set("note_coverage95", row.note_coverage);
  o.set("covariance_deviation", row.covariance_deviation).set("passed", row.passed);
  return o;
}

void writeEstimatorReport(const std::string& directory, const std::string& command_line, const Rows& rows) {
  Report report(directory, "Constrained estimation: do minimum, covariance and corrections follow their laws?");
  showVerdict(report, formatEstimatorTables(rows));
  report.paragraph(
      "Each trial draws measurements with noise and estimates a parameter from them under implicit equations and "
      "constraints. To first order in the noise the minimum 2 L2 follows a chi-square law with the residual degrees of "
      "freedom, and the squared Mahalanobis distance of the truth one with as many as there are free parameters. Rows "
      "without a verdict are of a noise at which curvature counts; a prototype's figures stand beside them.");
  report.code(command_line);
  for (const Part& part : parts) {
    const std::vector<Cells> cells = cellsOf(part, rows);
    if (cells.empty()) continue;
    report.section(part.title);
    report.table(part.headers, cells, part.caption);
    std::vector<Panel> histograms;
    for (const EstimatorRow& row : rows) {
      if (!part.holds(row.quantity)) continue;
      histograms.push_back(
          histogramPanel(row, fmt::format("{}, sigma {:g}, {}", name(row.experiment), row.sigma, name(row.quantity))));
    }
    report.plot({.name = fmt::format("histograms_{}", &part - parts),
                 .caption = "Distances of the trials with the density that they should have.",
                 .panels = histograms,
                 .columns = 4});
  }
  report.write();
}

}  // namespace liestat::cli
