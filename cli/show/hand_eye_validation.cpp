#include <cli/show/hand_eye_validation.hpp>

#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/units.hpp>
#include <cli/show/validation.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>

namespace liestat::cli {
using namespace experiments;
namespace {

using Cells = std::vector<std::string>;
using Rows = std::vector<HandEyeRow>;

std::string orNothing(double value, int digits = 3) { return std::isnan(value) ? "" : number(value, digits); }
std::string inDegrees(double radians) { return orNothing(degrees * radians); }
std::string inMillimetres(double metres) { return orNothing(1e3 * metres); }
std::string noiseName(const HandEyeRow& row) {
  return row.scale == 1 ? name(row.noise) : fmt::format("{} x{:g}", name(row.noise), row.scale);
}
/// The index where there are distances.
std::string indexCell(const HandEyeRow& row) { return row.report.index > 0 ? number(row.report.index, 3) : ""; }
std::string coverageCell(const HandEyeRow& row) {
  return row.report.index > 0 ? fmt::format("{:.3f}", row.report.coverage[2].observed) : "";
}
std::string rightCell(const HandEyeRow& row) { return fmt::format("{}/{}", row.right, row.trials); }

/// One table: its rows, and how each looks.
struct Part {
  HandEyeExperiment experiment;
  bool fit;
  const char* title;
  const char* caption;
  Cells headers;
  Cells (*cells)(const HandEyeRow& row);
};

const Part parts[] = {
    {HandEyeExperiment::accuracy,
     false,
     "AX = YB: errors of X and its covariance",
     "RMS errors beside a prototype's (note); mean squared distance, 6 expected.",
     {"noise", "n", "deg", "note", "mm", "note", "index", "95 %", "chi2/dof", "verdict"},
     [](const HandEyeRow& row) -> Cells {
       return {noiseName(row),
               fmt::format("{}", row.pairs),
               inDegrees(row.rms_rotation),
               inDegrees(row.note_rotation),
               inMillimetres(row.rms_translation),
               inMillimetres(row.note_translation),
               indexCell(row),
               coverageCell(row),
               number(row.chi2_per_dof, 3),
               verdictCell(row.answer())};
     }},
    {HandEyeExperiment::accuracy,
     true,
     "AX = YB: squared distance of the poses from the corrected ones",
     "It follows a chi-square law with 6 n - 12 degrees of freedom.",
     {"noise", "n", "r", "mean", "K-S p", "verdict"},
     [](const HandEyeRow& row) -> Cells {
       return {noiseName(row),           fmt::format("{}", row.pairs),     fmt::format("{}", row.report.dof),
               number(row.report.index), number(row.report.ks_p_value, 2), verdictCell(row.answer())};
     }},
    {HandEyeExperiment::motions,
     false,
     "Motions: the directions that they leave open",
     "Trials with the right number; index and coverage of the rest, k expected.",
     {"problem", "motion", "open", "right", "k", "index", "95 %", "verdict"},
     [](const HandEyeRow& row) -> Cells {
       return {row.formulation == HandEyeFormulation::poses ? "AX = YB" : "AX = XB",
               name(row.motion),
               fmt::format("{}", openDimension(row.motion)),
               rightCell(row),
               fmt::format("{}", row.report.dof),
               indexCell(row),
               coverageCell(row),
               verdictCell(row.answer())};
     }},
    {HandEyeExperiment::outliers,
     false,
     "Three wrong pairs of ten",
     "Trials in which all were found; right pairs lost, 0.1 % expected.",
     {"noise", "wrong pairs", "found", "lost %", "index", "95 %", "verdict"},
     [](const HandEyeRow& row) -> Cells {
       return {noiseName(row), name(*row.outliers), rightCell(row),           fmt::format("{:.2f}", 100 * row.lost),
               indexCell(row), coverageCell(row),   verdictCell(row.answer())};
     }},
    {HandEyeExperiment::formulations,
     false,
     "The same poses as relative motions, for comparison",
     "Pairs that share a pose are correlated, and chi2/dof does not show it.",
     {"pairs of motions", "n", "deg", "mm", "index", "95 %", "chi2/dof"},
     [](const HandEyeRow& row) -> Cells {
       return {row.formulation == HandEyeFormulation::poses ? "none: AX = YB" : name(row.formulation),
               fmt::format("{}", row.pairs),
               inDegrees(row.rms_rotation),
               inMillimetres(row.rms_translation),
               indexCell(row),
               coverageCell(row),
               number(row.chi2_per_dof, 3)};
     }}};

std::vector<Cells> cellsOf(const Part& part, const Rows& rows) {
  std::vector<Cells> list;
  for (const HandEyeRow& row : rows) {
    if (row.experiment == part.experiment && row.fit == part.fit) list.push_back(part.cells(row));
  }
  return list;
}
std::string titleOf(const HandEyeRow& row) {
  std::string text = fmt::format("{} {} n = {}", name(row.formulation), noiseName(row), row.pairs);
  if (row.motion != HandEyeMotion::general) text += " " + name(row.motion);
  if (row.outliers) text += " " + name(*row.outliers);
  return row.fit ? text + ", fit" : text;
}

}  // namespace

std::string formatHandEyeTables(const Rows& rows) {
  std::string text;
  for (const Part& part : parts) {
    const std::vector<Cells> cells = cellsOf(part, rows);
    if (cells.empty()) continue;
    Table table(part.headers);
    for (const Cells& row : cells) table.row(row);
    text += fmt::format("\n{}\n{}\n{}", part.title, part.caption, table.str());
  }
  std::string reasons;
  for (const HandEyeRow& row : rows) {
    if (!row.right_passed.value_or(true)) {
      reasons += fmt::format("FAILED {} {}: {} of {} trials right\n", name(row.experiment), titleOf(row), row.right,
                             row.trials);
    }
    if (!row.passed.value_or(true)) {
      reasons += fmt::format("FAILED {} {}: {}\n", name(row.experiment), titleOf(row), reason(row.verdict));
    }
  }
  return fmt::format("{}\n{}{}", text, reasons,
                     verdictLines(tally(rows) + countedTally(rows), "where they are promised"));
}

JsonObject toJson(const HandEyeRow& row) {
  JsonObject o;
  o.set("experiment", name(row.experiment)).set("formulation", name(row.formulation)).set("motion", name(row.motion));
  o.set("noise", name(row.noise)).set("noise_scale", row.scale).set("pairs", row.pairs);
  if (row.outliers) {
    o.set("outliers", name(*row.outliers));
  } else {
    o.set("outliers", nullptr);
  }
  o.set("quantity", row.fit ? "fit" : "calibration").set("in_domain", row.promise.has_value());
  setStatistics(o, row.report);
  o.set("rms_rotation", row.rms_rotation).set("rms_translation", row.rms_translation);
  o.set("note_rms_rotation", row.note_rotation).set("note_rms_translation", row.note_translation);
  o.set("chi2_per_dof", row.chi2_per_dof).set("right", row.right).set("right_passed", row.right_passed);
  o.set("lost", row.lost).set("failures", row.report.failures).set("passed", row.passed);
  return o;
}

void writeHandEyeReport(const std::string& directory, const std::string& command_line, const Rows& rows) {
  Report report(directory, "Hand-eye calibration: do errors, residuals and open directions follow their laws?");
  showVerdict(report, formatHandEyeTables(rows));
  report.paragraph(
      "Each trial draws the poses of a camera on a gripper that looks at a target, with noise in both poses, and "
      "estimates gripper_T_camera from them. The squared Mahalanobis distance of the truth follows a chi-square law "
      "with "
      "as many degrees of freedom as the motion determines, that of the poses from the corrected ones a law with the "
      "residual degrees of freedom.");
  report.code(command_line);
  for (const Part& part : parts) {
    const std::vector<Cells> cells = cellsOf(part, rows);
    if (cells.empty()) continue;
    report.section(part.title);
    report.table(part.headers, cells, part.caption);
    std::vector<Panel> histograms;
    for (const HandEyeRow& row : rows) {
      if (row.experiment != part.experiment || row.fit != part.fit || !(row.report.index > 0)) continue;
      histograms.push_back(histogramPanel(row, titleOf(row)));
    }
    report.plot({.name = fmt::format("histograms_{}", &part - parts),
                 .caption = "Distances of the trials with the density that they should have.",
                 .panels = histograms,
                 .columns = 4});
  }
  report.write();
}

}  // namespace liestat::cli
