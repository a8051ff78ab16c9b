#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/motion_validation.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>

namespace liestat::cli {
using namespace experiments;
namespace {

using Cells = std::vector<std::string>;

std::string titleOf(MotionMethod method) {
  constexpr const char* names[] = {"Subspace filter, 32 starts, midpoint flow",
                                   "Subspace filter, one start anywhere",
                                   "Subspace filter, the report's forward difference",
                                   "Subspace filter, discrete flow without a gyroscope",
                                   "Subspace filter, covariance without second derivatives",
                                   "Subspace filter, depths of either sign",
                                   "Subspace filter, one start 10 degrees off",
                                   "Search over 300 directions (Heeger and Jepson)",
                                   "Essential filter, 32 starts",
                                   "Essential filter, start 30 % off",
                                   "Composition: subspace filter, then essential filter",
                                   "Subspace filter, pairs of up to six frames (orbit) or four",
                                   "Subspace filter with a gyroscope",
                                   "Subspace filter with a gyroscope, its bias a state",
                                   "Subspace filter with a gyroscope among outliers",
                                   "Essential filter with a gyroscope, its bias a state"};
  return names[static_cast<std::size_t>(method)];
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

ValidationTable tableOf(const std::vector<MotionRow>& rows, MotionMethod method) {
  ValidationTable table{.title = titleOf(method), .headers = headers};
  Panel success{.title = "errors below 10 degrees",
                .x = {.label = "frame", .low = 0.0},
                .y = {.label = "share", .low = 0.0, .high = 1.05}};
  Panel median{
      .title = "median error", .x = {.label = "frame", .low = 0.0}, .y = {.label = "degrees", .logarithmic = true}};
  for (const MotionRow& row : rows) {
    if (row.method != method) continue;
    table.rows.push_back(cellsOf(row));
    Series share{.name = fmt::format("{}, {:g} px", sceneOf(row), row.scene.sigma), .style = Style::linespoints};
    Series error = share;
    for (std::size_t k = 0; k < motion_frames.size(); ++k) {
      share.x.push_back(motion_frames[k]), error.x.push_back(motion_frames[k]);
      share.y.push_back(static_cast<double>(row.successes[k]) / static_cast<double>(row.trials));
      error.y.push_back(row.median[k]);
    }
    success.series.push_back(share), median.series.push_back(error);
  }
  table.plots = {{.name = name(method), .caption = "", .panels = {success, median}}};
  return table;
}

}  // namespace

ValidationView viewOf(const std::vector<MotionRow>& rows) {
  ValidationView view{
      .title = "Recursive motion: is the direction found, how well, and is its covariance true?",
      .introduction =
          "Each trial moves a camera among points for 100 frames and runs a filter over their tracks. A run is a "
          "success where the direction of translation is off by less than 10 degrees. Where the covariance is right, "
          "half of the squared error in its units is 1 on average, and 95 % of the errors are in its 95 % region; "
          "below 1 it is an upper bound.",
      .judgement = judgementOf(rows),
      .fields = [&rows](JsonObject& object) { object("rows", rows); },
      .legend = fmt::format("\nSuccess: errors below {:g} degrees (%); median error (deg); at frames 20, 50, 100.\n"
                            "xPx/2: squared errors of the successes in units of their covariance, at most 1.\n",
                            motion_success)};
  for (const MotionMethod method : all_motion_methods) view.tables.push_back(tableOf(rows, method));
  return view;
}

}  // namespace liestat::cli
