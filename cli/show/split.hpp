#pragma once

// Views of `liestat validate split`, of the measurements in a file and of landmarks that a stereo camera saw.

#include <cli/commands/measurements.hpp>
#include <cli/commands/mean_analysis.hpp>
#include <stats/split_validation_types.hpp>

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// The measurements of one file.
struct FileSplit : SplitSummary {
  std::string source;       ///< the file
  std::string description;  ///< the measurements in words
  std::vector<std::string> notes;
};

/// One object of a stereo track set.
struct LandmarkSplit {
  std::size_t track = 0;
  SplitSummary split;
  MeanAnalysis whole;
  std::optional<Eigen::Vector3d> survey = {};

  double surveyDistance() const;         ///< m; NaN without a survey
  double squaredSurveyDistance() const;  ///< under the covariance of the mean; NaN without one of the two
};

template <class V>
void describe(V& v, const LandmarkSplit& row) {
  v("track", row.track)("n", row.split.n)("random", row.split.random.index, "index of halves at random");
  v("by_blocks", row.split.by_blocks.index)("inflation", row.split.by_blocks.factor());
  v("mean", row.whole.mean.point.value_or(Eigen::Vector3d::Zero()))("squared_distance", row.split.squared_distance);
  v("survey_distance", row.surveyDistance(), "", "m")("survey_squared_distance", row.squaredSurveyDistance());
}

/// Several landmarks, pooled.
struct LandmarkSplits : SplitOutcome {
  std::string source;       ///< the prefix of the files
  std::string description;  ///< the measurements in words
  Criterion criterion = Criterion::maha;
  std::vector<LandmarkSplit> landmarks;
  std::size_t skipped = 0;  ///< landmarks with too few observations
  bool surveyed = false;

  double surveyRms() const;              ///< m
  double surveySquaredDistance() const;  ///< mean over the landmarks; 3 expected
};

template <class V>
void describe(V& v, const LandmarkSplits& split) {
  describe(v, static_cast<const SplitOutcome&>(split));
  v("criterion", name(split.criterion))("skipped", split.skipped, "landmarks with too few observations");
  const auto surveyed = [&](double value) { return split.surveyed ? std::optional(value) : std::nullopt; };
  v("survey_rms", surveyed(split.surveyRms()), "", "m");
  v("survey_squared_distance", surveyed(split.surveySquaredDistance()), "3 expected")("landmarks", split.landmarks);
}

/// Lines for the terminal, the verdict last.
std::string formatSplit(const FileSplit& split);
std::string formatSplit(const LandmarkSplits& split);

/// The page with its plots.
void writeSplitReport(const std::string& directory, const std::string& command_line, const FileSplit& split);
void writeSplitReport(const std::string& directory, const std::string& command_line, const LandmarkSplits& split);

}  // namespace liestat::cli
