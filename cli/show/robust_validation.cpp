#include <cli/show/robust_validation.hpp>

#include <report/page.hpp>
#include <report/table.hpp>
#include <cli/show/validation.hpp>

#include <fmt/format.h>

#include <algorithm>
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
  switch (score) {
    case RobustScore::relevance:
      return "relevance";
    case RobustScore::truncated_cost:
      return "truncated";
    case RobustScore::inlier_count:
      return "count";
    case RobustScore::trimmed_quantile:
      return "quantile";
  }
  return "";
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

/// The structures of the rows, in their order.
std::vector<RobustStructure> structuresOf(const RobustValidationResult& result) {
  std::vector<RobustStructure> list;
  for (const RobustRow& row : result.rows) {
    if (list.empty() || list.back() != row.structure) list.push_back(row.structure);
  }
  return list;
}
std::vector<Cells> searchesOf(const RobustValidationResult& result, RobustStructure structure) {
  std::vector<Cells> list;
  for (const RobustRow& row : result.rows) {
    if (row.structure == structure) list.push_back(searchCells(row));
  }
  return list;
}
std::string titleOf(const RobustRow& row) {
  const bool conic = row.structure == RobustStructure::conic;
  return fmt::format("{}: index {} expected, distances over {:.3f} (cut errors)",
                     conic ? "Conic, samples of 5" : "Homography, samples of 4", row.report.dof, row.cut_factor);
}
const RobustRow& firstOf(const RobustValidationResult& result, RobustStructure structure) {
  return *std::find_if(result.rows.begin(), result.rows.end(),
                       [&](const RobustRow& row) { return row.structure == structure; });
}
constexpr const char* thresholds_title = "Thresholds found in the errors (% of the trials), in standard deviations";

}  // namespace

std::string formatRobustTables(const RobustValidationResult& result) {
  std::string text;
  for (const RobustStructure structure : structuresOf(result)) {
    Table table(search_headers);
    for (const Cells& row : searchesOf(result, structure)) table.row(row);
    text += fmt::format("\n{}\n{}", titleOf(firstOf(result, structure)), table.str());
  }
  if (!result.thresholds.empty()) {
    Table table(threshold_headers);
    for (const ThresholdRow& row : result.thresholds) table.row(thresholdCells(row));
    text += fmt::format("\n{}\n{}", thresholds_title, table.str());
  }
  std::string reasons;
  for (const RobustRow& row : result.rows) {
    const std::string which =
        fmt::format("FAILED {}, {:g} % outliers, {}", name(row.structure), 100 * row.outliers, name(row.score));
    if (!row.found_passed.value_or(true)) {
      reasons += fmt::format("{}: found in {} of {} trials, {:g} % are promised\n", which, row.found, row.trials,
                             100 * row.confidence);
    }
    if (!row.passed.value_or(true)) reasons += fmt::format("{}: {}\n", which, reason(row.verdict));
  }
  return fmt::format("{}\n{}{}", text, reasons,
                     verdictLines(tally(result.rows) + result.tally(),
                                  fmt::format("with up to {:g} % outliers", 100 * robust_promise)));
}

JsonObject toJson(const RobustRow& row) {
  JsonObject o;
  o.set("structure", name(row.structure)).set("score", name(row.score)).set("outliers", row.outliers);
  setStatistics(o, row.report);
  o.set("cut_factor", row.cut_factor).set("tail", row.tail).set("in_domain", row.promise.has_value());
  o.set("found", row.found).set("confidence", row.confidence).set("found_passed", row.found_passed);
  o.set("inliers_right", row.right).set("outliers_wrong", row.wrong);
  o.set("draws", row.draws).set("draws_needed", row.needed).set("passed", row.passed);
  return o;
}

JsonObject toJson(const ThresholdRow& row) {
  JsonObject o;
  o.set("structure", name(row.structure)).set("outliers", row.outliers).set("trials", row.trials);
  o.set("histogram_found", row.histogram_found).set("histogram_mean", row.histogram_mean);
  o.set("histogram_sd", row.histogram_sd).set("moments_found", row.moments_found);
  o.set("moments_median", row.moments_median).set("moments_tenth", row.moments_tenth);
  return o;
}

void writeRobustReport(const std::string& directory, const std::string& command_line,
                       const RobustValidationResult& result) {
  Report report(directory, "Robust search: is the structure found, and is the covariance of what is found true?");
  showVerdict(report, formatRobustTables(result));
  report.paragraph(
      "Each trial draws measurements of a structure among outliers and searches until, with the confidence that was "
      "asked for, one of the draws was of inliers alone. The structure counts as found where nine tenths of its "
      "measurements are inliers of the refined estimate. Of these trials the squared Mahalanobis distance of the truth "
      "follows a chi-square law if the covariance is true.");
  report.code(command_line);
  for (const RobustStructure structure : structuresOf(result)) {
    std::vector<Panel> histograms;
    for (const RobustRow& row : result.rows) {
      if (row.structure != structure) continue;
      histograms.push_back(histogramPanel(row, fmt::format("{:g} %, {}", 100 * row.outliers, name(row.score))));
    }
    report.section(titleOf(firstOf(result, structure)));
    report.table(search_headers, searchesOf(result, structure));
    report.plot({.name = "distances_" + name(structure),
                 .caption = "Squared distances of the truth with the density that they should have.",
                 .panels = histograms,
                 .columns = 4});
  }
  if (!result.thresholds.empty()) {
    std::vector<Cells> rows;
    for (const ThresholdRow& row : result.thresholds) rows.push_back(thresholdCells(row));
    report.section(thresholds_title);
    report.table(threshold_headers, rows, "Of the conic. The moments of normal errors give 4.42.");
  }
  report.write();
}

}  // namespace liestat::cli
