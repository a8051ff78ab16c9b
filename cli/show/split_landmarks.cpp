#include <report/page.hpp>
#include <cli/show/split.hpp>
#include <report/table.hpp>
#include <stats/gaussian.hpp>

#include <fmt/format.h>

#include <cmath>
#include <limits>

namespace liestat::cli {
namespace {

const std::vector<std::string> headers{"track", "n", "random", "blocks", "factor", "survey (mm)", "squared distance"};

std::vector<std::vector<std::string>> cells(const LandmarkSplits& split) {
  std::vector<std::vector<std::string>> rows;
  for (const LandmarkSplit& row : split.landmarks) {
    rows.push_back({fmt::format("{}", row.track), fmt::format("{}", row.split.n), number(row.split.random.index),
                    number(row.split.by_blocks.index), number(row.split.by_blocks.factor()),
                    number(1000 * row.surveyDistance()), number(row.squaredSurveyDistance())});
  }
  return rows;
}

}  // namespace

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
  Table table(headers);
  for (const auto& row : cells(split)) table.row(row);
  text += table.str() + "\n";
  if (split.surveyed) {
    text += fmt::format("to the survey: {} mm RMS, mean squared distance {} where 3 is expected\n",
                        number(1000 * split.surveyRms()), number(split.surveySquaredDistance()));
  }
  return text + splitVerdict(split);
}

void writeSplitReport(const std::string& directory, const std::string& command_line, const LandmarkSplits& split) {
  Report report(directory, "Split of the landmarks in " + split.source);
  report.verdict(split.verdict());
  report.paragraph(split.description + ".");
  report.code(command_line);
  report.code(formatSplit(split));
  report.table(headers, cells(split), "Indices of the splits, and the mean of all measurements against the survey.");
  plotSplits(report, split);
  report.write();
}

}  // namespace liestat::cli
