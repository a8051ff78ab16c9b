#include <cli/show/split.hpp>

#include <cli/show/mean.hpp>
#include <report/page.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace liestat::cli {
namespace {

std::string seriesInWords(const char* what, const SplitSeries& s) {
  if (s.distances.empty()) return fmt::format("{:<22} none was done\n", what);
  return fmt::format("{:<22} index {} (expected {} +- {}), p = {}\n", what, number(s.index), number(s.dof),
                     number(s.standardError(), 2), number(s.pValue(), 2));
}

std::vector<std::string> halfRow(const char* what, const SplitHalf& half) {
  std::string sd;
  for (const TangentBlock& part : half.parts) {
    if (half.covariance.size() == 0) continue;
    const Eigen::VectorXd variances = half.covariance.diagonal().segment(part.begin, part.size);
    sd += fmt::format("{}{} {}", sd.empty() ? "" : ", ",
                      number(unitOf(part).scale * std::sqrt(variances.maxCoeff()), 3), unitOf(part).name);
  }
  return {what, fmt::format("{}", half.n), oneLine(half.mean), sd.empty() ? "none" : sd};
}

std::vector<std::vector<std::string>> halfRows(const SplitSummary& split) {
  return {halfRow("first half", split.first), halfRow("second half", split.second), halfRow("merged", split.merged)};
}

}  // namespace

std::string splitVerdict(const SplitOutcome& outcome) {
  const SplitSeries& blocks = outcome.by_blocks;
  std::string text = seriesInWords("halves at random", outcome.random);
  text += seriesInWords(fmt::format("halves of {} blocks", outcome.settings.blocks).c_str(), blocks);
  const std::size_t failures = outcome.random.failures + blocks.failures;
  if (failures > 0) text += fmt::format("{} splits had no estimate and are left out.\n", failures);
  text += "\n";
  const Verdict verdict = outcome.verdict();
  for (const std::string& cause : verdict.causes) text += wrapped(cause);
  return text + wrapped(verdict.text);
}

void plotSplits(Report& report, const SplitOutcome& outcome) {
  const auto panel = [&](const char* title, const SplitSeries& s) {
    double high = 0;
    for (const double d : s.distances) high = std::max(high, std::isfinite(d) ? d : 0);
    if (!(high > 0)) high = 1;
    Series boxes = histogram("splits", s.distances, 0, high, 30, true);
    Panel p{.title = title,
            .x = {.label = "squared distance of the halves", .low = 0.0},
            .y = {.label = "density", .low = 0.0},
            .series = {boxes}};
    p.references = {{.direction = ReferenceLine::Direction::vertical, .at = s.dof}};
    return p;
  };
  std::vector<Panel> panels = {panel("Halves at random", outcome.random)};
  if (!outcome.by_blocks.distances.empty()) panels.push_back(panel("Halves of blocks of time", outcome.by_blocks));
  report.plot({.name = "splits",
               .caption =
                   "Squared distances of the two halves' means under both covariances, over the splits; the line "
                   "is what is expected on average.",
               .panels = panels});
}

std::string formatSplit(const FileSplit& split) {
  std::string text = split.description + "\n";
  text += fmt::format("means by {}, covariances from {}\n\n", name(split.criterion),
                      split.known_noise ? "the measurements' own" : "the residuals");
  for (const auto& row : halfRows(split)) text += fmt::format("{:<12} {} (largest sd {})\n", row[0], row[2], row[3]);
  text += fmt::format("squared distance of both halves {} ({}, p = {})\n\n", number(split.squared_distance), split.law,
                      number(split.p_value, 2));
  text += splitVerdict(split);
  for (const std::string& note : split.notes) text += "note: " + note + "\n";
  return text;
}

void writeSplitReport(const std::string& directory, const std::string& command_line, const FileSplit& split) {
  Report report(directory, "Split of the measurements in " + split.source);
  report.verdict(split.verdict());
  report.paragraph(split.description + ".");
  report.code(command_line);
  report.code(formatSplit(split));
  report.table({"", "n", "mean", "largest standard deviations"}, halfRows(split), "Halves in time, and both merged.");
  plotSplits(report, split);
  report.write();
}

}  // namespace liestat::cli
