#include <cli/show/motion_validation.hpp>

#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/validation.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace liestat::cli {
using namespace experiments;
namespace {

using Cells = std::vector<std::string>;

std::string titleOf(MotionMethod method) {
  switch (method) {
    case MotionMethod::subspace:
      return "Subspace filter, 32 starts, midpoint flow";
    case MotionMethod::single_start:
      return "Subspace filter, one start anywhere";
    case MotionMethod::forward:
      return "Subspace filter, the report's forward difference";
    case MotionMethod::discrete:
      return "Subspace filter, discrete flow without a gyroscope";
    case MotionMethod::gauss_newton:
      return "Subspace filter, covariance without second derivatives";
    case MotionMethod::released:
      return "Subspace filter, depths of either sign";
    case MotionMethod::near_start:
      return "Subspace filter, one start 10 degrees off";
    case MotionMethod::search:
      return "Search over 300 directions (Heeger and Jepson)";
    case MotionMethod::essential:
      return "Essential filter, 32 starts";
    case MotionMethod::essential_near:
      return "Essential filter, start 30 % off";
    case MotionMethod::composition:
      return "Composition: subspace filter, then essential filter";
    case MotionMethod::intervals:
      return "Subspace filter, pairs of up to six frames (orbit) or four";
    case MotionMethod::gyroscope:
      return "Subspace filter with a gyroscope";
    case MotionMethod::gyroscope_bias:
      return "Subspace filter with a gyroscope, its bias a state";
    case MotionMethod::gyroscope_robust:
      return "Subspace filter with a gyroscope among outliers";
    case MotionMethod::essential_bias:
      return "Essential filter with a gyroscope, its bias a state";
  }
  return "";
}

/// A scene in one cell: the world and what is not the default.
std::string sceneOf(const MotionRow& row) {
  const MotionSceneOptions normal;
  std::string text = nameOf(row.scene.world);
  if (row.scene.rotation != normal.rotation) text += fmt::format(" {:g} deg", row.scene.rotation);
  if (row.scene.points != normal.points) text += fmt::format(" N={}", row.scene.points);
  if (row.scene.gyroscope_sigma > 0) text += fmt::format(" g {:g}", row.scene.gyroscope_sigma);
  if (row.scene.gyroscope_bias > 0) text += fmt::format(" b {:g}", row.scene.gyroscope_bias);
  if (row.scene.outliers > 0) text += fmt::format(" {:g} % out", 100 * row.scene.outliers);
  return text;
}

const Cells headers{"scene", "px", "20: % deg", "50: % deg", "100: % deg", "xPx/2", "95 %", "verdict"};
std::string degrees(double value) { return fmt::format("{:.{}f}", value, value < 9.995 ? 2 : 1); }
Cells cellsOf(const MotionRow& row) {
  Cells cells{sceneOf(row), fmt::format("{:g}", row.scene.sigma)};
  for (std::size_t k = 0; k < motion_frames.size(); ++k) {
    const double share = 100. * static_cast<double>(row.successes[k]) / static_cast<double>(row.trials);
    cells.push_back(fmt::format("{:3.0f} {:>5}", share, degrees(row.median[k])));
  }
  const bool covariance = std::isfinite(row.consistency.back());
  cells.push_back(covariance ? fmt::format("{:.2f}", row.consistency.back()) : "");
  cells.push_back(covariance ? fmt::format("{:.1f}", 100 * row.coverage) : "");
  cells.push_back(verdictCell(row.passed));
  return cells;
}

std::vector<MotionMethod> methodsOf(const std::vector<MotionRow>& rows) {
  std::vector<MotionMethod> list;
  for (const MotionRow& row : rows) {
    if (std::find(list.begin(), list.end(), row.method) == list.end()) list.push_back(row.method);
  }
  return list;
}
std::vector<Cells> rowsOf(const std::vector<MotionRow>& rows, MotionMethod method) {
  std::vector<Cells> list;
  for (const MotionRow& row : rows) {
    if (row.method == method) list.push_back(cellsOf(row));
  }
  return list;
}

}  // namespace

std::string formatMotionTables(const std::vector<MotionRow>& rows) {
  std::string text;
  for (const MotionMethod method : methodsOf(rows)) {
    Table table(headers);
    for (const Cells& row : rowsOf(rows, method)) table.row(row);
    text += fmt::format("\n{}\n{}", titleOf(method), table.str());
  }
  std::string reasons;
  for (const MotionRow& row : rows) {
    if (row.passed.value_or(true)) continue;
    reasons += fmt::format("FAILED {}, {}, {:g} px: {}\n", name(row.method), sceneOf(row), row.scene.sigma, row.reason);
  }
  return fmt::format(
      "{}\nSuccess: errors below {:g} degrees (%); median error (deg); at frames 20, 50, 100.\n"
      "xPx/2: squared errors of the successes in units of their covariance, at most 1.\n\n{}{}",
      text, motion_success, reasons, verdictLines(tally(rows), "with a promise"));
}

JsonObject toJson(const MotionRow& row) {
  JsonObject o;
  o.set("method", name(row.method)).set("scene", nameOf(row.scene.world)).set("sigma_px", row.scene.sigma);
  o.set("points", row.scene.points).set("rotation_deg", row.scene.rotation).set("outliers", row.scene.outliers);
  o.set("gyroscope_sigma_deg", row.scene.gyroscope_sigma).set("gyroscope_bias_deg", row.scene.gyroscope_bias);
  o.set("trials", row.trials);
  for (std::size_t k = 0; k < motion_frames.size(); ++k) {
    const std::string at = "_" + std::to_string(motion_frames[k]);
    o.set("successes" + at, row.successes[k]).set("median_deg" + at, row.median[k]);
    o.set("consistency" + at, row.consistency[k]);
    if (row.promise && row.promise->success[k] > 0) o.set("promised_success" + at, row.promise->success[k]);
    if (row.promise && row.promise->median[k] > 0) o.set("promised_median_deg" + at, row.promise->median[k]);
  }
  o.set("coverage95", row.coverage).set("convergence_frame", row.convergence);
  if (row.promise && row.promise->coverage > 0) o.set("promised_coverage95", row.promise->coverage);
  o.set("usable", row.usable).set("usable_wrong", row.usable_wrong);
  o.set("in_domain", row.promise.has_value()).set("passed", row.passed).set("reason", row.reason);
  return o;
}

void writeMotionReport(const std::string& directory, const std::string& command_line,
                       const std::vector<MotionRow>& rows) {
  Report report(directory, "Recursive motion: is the direction found, how well, and is its covariance true?");
  showVerdict(report, formatMotionTables(rows));
  report.paragraph(
      "Each trial moves a camera among points for 100 frames and runs a filter over their tracks. A run is a success "
      "where "
      "the direction of translation is off by less than 10 degrees. Where the covariance is right, half of the squared "
      "error in its units is 1 on average, and 95 % of the errors are in its 95 % region; below 1 it is an upper "
      "bound.");
  report.code(command_line);
  for (const MotionMethod method : methodsOf(rows)) {
    report.section(titleOf(method));
    report.table(headers, rowsOf(rows, method));
    Panel success{.title = "errors below 10 degrees",
                  .x = {.label = "frame", .low = 0.0},
                  .y = {.label = "share", .low = 0.0, .high = 1.05}};
    Panel median{
        .title = "median error", .x = {.label = "frame", .low = 0.0}, .y = {.label = "degrees", .logarithmic = true}};
    for (const MotionRow& row : rows) {
      if (row.method != method) continue;
      Series share{.name = fmt::format("{}, {:g} px", sceneOf(row), row.scene.sigma), .style = Style::linespoints};
      Series error = share;
      for (std::size_t k = 0; k < motion_frames.size(); ++k) {
        share.x.push_back(motion_frames[k]), error.x.push_back(motion_frames[k]);
        share.y.push_back(static_cast<double>(row.successes[k]) / static_cast<double>(row.trials));
        error.y.push_back(row.median[k]);
      }
      success.series.push_back(share), median.series.push_back(error);
    }
    report.plot({.name = name(method), .caption = "", .panels = {success, median}});
  }
  report.write();
}

}  // namespace liestat::cli
