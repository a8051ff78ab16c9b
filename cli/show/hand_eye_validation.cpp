#include <report/table.hpp>
#include <cli/show/units.hpp>
#include <cli/show/validations.hpp>
#include <experiments/hand_eye_validation.hpp>

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

ValidationTable tableOf(const Part& part, const Rows& rows) {
  ValidationTable table{.title = part.title, .caption = part.caption, .headers = part.headers};
  Plot histograms{.name = fmt::format("histograms_{}", &part - parts),
                  .caption = "Distances of the trials with the density that they should have.",
                  .columns = 4};
  for (const HandEyeRow& row : rows) {
    if (row.experiment != part.experiment || row.fit != part.fit) continue;
    table.rows.push_back(part.cells(row));
    if (row.report.index > 0) histograms.panels.push_back(histogramPanel(row, label(row)));
  }
  table.plots = {std::move(histograms)};
  return table;
}

}  // namespace

ValidationView viewOf(const Rows& rows) {
  ValidationView view{
      .title = "Hand-eye calibration: do errors, residuals and open directions follow their laws?",
      .introduction =
          "Each trial draws the poses of a camera on a gripper that looks at a target, with noise in both poses, and "
          "estimates gripper_T_camera from them. The squared Mahalanobis distance of the truth follows a chi-square "
          "law "
          "with as many degrees of freedom as the motion determines, that of the poses from the corrected ones a law "
          "with the residual degrees of freedom.",
      .judgement = judgementOf(rows),
      .fields = [&rows](JsonObject& object) { object("rows", rows); }};
  for (const Part& part : parts) view.tables.push_back(tableOf(part, rows));
  return view;
}

}  // namespace liestat::cli
