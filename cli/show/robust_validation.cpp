#include <report/table.hpp>
#include <cli/show/validations.hpp>
#include <experiments/robust_validation.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

using Cells = std::vector<std::string>;

std::string percent(double share) { return std::isnan(share) ? "" : fmt::format("{:.1f}", 100 * share); }
double share(std::size_t part, std::size_t all) { return static_cast<double>(part) / static_cast<double>(all); }

/// The names of the scores, for narrow columns.
const char* shortName(RobustScore score) {
  constexpr const char* names[] = {"relevance", "truncated", "count", "quantile"};
  return names[static_cast<std::size_t>(score)];
}

// In per cent: share of outliers, trials that found the structure, inliers and outliers among the estimate's inliers,
// coverage of the 95 % region.
const Cells search_headers{"out %",   "score",   "found", "draws", "needed",
                           "right %", "wrong %", "index", "95 %",  "verdict"};
Cells searchCells(const RobustRow& row) {
  return {fmt::format("{:g}", 100 * row.outliers),
          shortName(row.score),
          percent(share(row.found, row.trials)),
          fmt::format("{:.0f}", row.draws),
          fmt::format("{}", row.needed),
          percent(row.right),
          percent(row.wrong),
          number(row.report.index, 3),
          percent(row.report.coverage[2].observed),
          verdictCell(row.answer())};
}

const Cells threshold_headers{"outliers %", "histogram %", "mean", "sd", "moments %", "median", "one in ten below"};
Cells thresholdCells(const ThresholdRow& row) {
  return {fmt::format("{:g}", 100 * row.outliers),
          percent(row.histogram_found),
          number(row.histogram_mean, 3),
          number(row.histogram_sd, 2),
          percent(row.moments_found),
          number(row.moments_median, 3),
          number(row.moments_tenth, 3)};
}

ValidationTable tableOf(const RobustValidationResult& result, RobustStructure structure) {
  const bool conic = structure == RobustStructure::conic;
  ValidationTable table{.headers = search_headers};
  Plot distances{.name = "distances_" + name(structure),
                 .caption = "Squared distances of the truth with the density that they should have.",
                 .columns = 4};
  for (const RobustRow& row : result.rows) {
    if (row.structure != structure) continue;
    table.title =
        fmt::format("{}: index {} expected, distances over {:.3f} (cut errors)",
                    conic ? "Conic, samples of 5" : "Homography, samples of 4", row.report.dof, row.cut_factor);
    table.rows.push_back(searchCells(row));
    distances.panels.push_back(histogramPanel(row, fmt::format("{:g} %, {}", 100 * row.outliers, name(row.score))));
  }
  table.plots = {std::move(distances)};
  return table;
}

}  // namespace

ValidationView viewOf(const RobustValidationResult& result) {
  ValidationView view{
      .title = "Robust search: is the structure found, and is the covariance of what is found true?",
      .introduction =
          "Each trial draws measurements of a structure among outliers and searches until, with the confidence that "
          "was "
          "asked for, one of the draws was of inliers alone. The structure counts as found where nine tenths of its "
          "measurements are inliers of the refined estimate. Of these trials the squared Mahalanobis distance of the "
          "truth follows a chi-square law if the covariance is true.",
      .judgement = judgementOf(result),
      .fields = [&result](JsonObject& object) { object.fieldsOf(result); }};
  for (const RobustStructure structure : all_robust_structures) view.tables.push_back(tableOf(result, structure));
  ValidationTable thresholds{.title = "Thresholds found in the errors (% of the trials), in standard deviations",
                             .headers = threshold_headers,
                             .page_caption = "Of the conic. The moments of normal errors give 4.42."};
  for (const ThresholdRow& row : result.thresholds) thresholds.rows.push_back(thresholdCells(row));
  view.tables.push_back(std::move(thresholds));
  return view;
}

}  // namespace liestat::cli
