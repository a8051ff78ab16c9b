#include <cli/show/split.hpp>

#include <cli/show/mean.hpp>
#include <report/page.hpp>
#include <report/table.hpp>
#include <stats/gaussian.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat::cli {
namespace {

std::string seriesInWords(const char* what, const SplitSeries& s) {
  if (s.distances.empty()) return fmt::format("{:<22} none was done\n", what);
  return fmt::format("{:<22} index {} (expected {} +- {}), p = {}\n", what, number(s.index), number(s.dof),
                     number(s.standardError(), 2), number(s.pValue(), 2));
}

/// The largest standard deviations of the parts of a half's mean.
std::string sigmasOf(const SplitHalf& half) {
  std::string sd;
  for (const TangentBlock& part : half.parts) {
    if (half.covariance.size() == 0) continue;
    const Eigen::VectorXd variances = half.covariance.diagonal().segment(part.begin, part.size);
    sd += fmt::format("{}{} {}", sd.empty() ? "" : ", ",
                      number(unitOf(part).scale * std::sqrt(variances.maxCoeff()), 3), unitOf(part).name);
  }
  return sd.empty() ? "none" : sd;
}

/// The halves in time, and both merged.
std::vector<std::vector<std::string>> halfRows(const SplitSummary& split) {
  const auto row = [](const char* what, const SplitHalf& half) -> std::vector<std::string> {
    return {what, std::to_string(half.n), oneLine(half.mean), sigmasOf(half)};
  };
  return {row("first half", split.first), row("second half", split.second), row("merged", split.merged)};
}

const Columns<LandmarkSplit> landmark_columns{
    {"track", &LandmarkSplit::track},
    {"n", [](const LandmarkSplit& row) { return row.split.n; }},
    {"random", [](const LandmarkSplit& row) { return row.split.random.index; }},
    {"blocks", [](const LandmarkSplit& row) { return row.split.by_blocks.index; }},
    {"factor", [](const LandmarkSplit& row) { return row.split.by_blocks.factor(); }},
    {"survey (mm)", [](const LandmarkSplit& row) { return 1000 * row.surveyDistance(); }},
    {"squared distance", &LandmarkSplit::squaredSurveyDistance}};

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

/// Histograms of the squared distances.
void plotSplits(Report& report, const SplitOutcome& outcome) {
  const auto panel = [&](const char* title, const SplitSeries& s) {
    double high = 0;
    for (const double d : s.distances) high = std::max(high, std::isfinite(d) ? d : 0);
    if (!(high > 0)) high = 1;
    Series boxes = histogram("splits", s.distances, 0, high, 30, true);
    Panel p{title, {.label = "squared distance of the halves", .low = 0.0}, {.label = "density", .low = 0.0}};
    p.series = {boxes};
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

/// The page; `table` and its caption are those of the subject.
template <class Split>
void writePage(const std::string& directory, const std::string& command_line, const char* title, const Split& split,
               const TableRows& table, const char* caption) {
  Report report(directory, title + split.source);
  report.verdict(split.verdict());
  report.paragraph(split.description + ".");
  report.code(command_line);
  report.code(formatSplit(split));
  report.table(table, caption);
  plotSplits(report, split);
  report.write();
}

}  // namespace

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
  writePage(directory, command_line, "Split of the measurements in ", split,
            {{"", "n", "mean", "largest standard deviations"}, halfRows(split)}, "Halves in time, and both merged.");
}

double LandmarkSplit::surveyDistance() const {
  return survey ? (*whole.mean.point - *survey).norm() : std::numeric_limits<double>::quiet_NaN();
}

double LandmarkSplit::squaredSurveyDistance() const {
  if (!survey || whole.covariance.rows() != 3) return std::numeric_limits<double>::quiet_NaN();
  return mahalanobisSquared(Gaussian<Eigen::Vector3d>{*whole.mean.point, Eigen::Matrix3d(whole.covariance)}, *survey);
}

double LandmarkSplits::surveyRms() const {
  double squares = 0;
  for (const LandmarkSplit& row : landmarks) squares += std::pow(row.surveyDistance(), 2);
  return std::sqrt(squares / static_cast<double>(landmarks.size()));
}

double LandmarkSplits::surveySquaredDistance() const {
  double sum = 0;
  for (const LandmarkSplit& row : landmarks) sum += row.squaredSurveyDistance();
  return sum / static_cast<double>(landmarks.size());
}

std::string formatSplit(const LandmarkSplits& split) {
  std::string text = split.description + "\n";
  text += fmt::format("means by {}, covariances from {}\n\n", name(split.criterion),
                      split.known_noise ? "the stereo geometry and the pixels' variances" : "the residuals");
  text += Table(tableOf(landmark_columns, split.landmarks)).str() + "\n";
  if (split.surveyed) {
    text += fmt::format("to the survey: {} mm RMS, mean squared distance {} where 3 is expected\n",
                        number(1000 * split.surveyRms()), number(split.surveySquaredDistance()));
  }
  return text + splitVerdict(split);
}

void writeSplitReport(const std::string& directory, const std::string& command_line, const LandmarkSplits& split) {
  writePage(directory, command_line, "Split of the landmarks in ", split, tableOf(landmark_columns, split.landmarks),
            "Indices of the splits, and the mean of all measurements against the survey.");
}

}  // namespace liestat::cli
