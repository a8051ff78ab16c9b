#pragma once

// Views of `liestat validate split`, of the measurements in a file and of landmarks that a stereo camera saw.

#include <cli/io/measurements.hpp>
#include <cli/commands/mean_analysis.hpp>
#include <cli/show/json.hpp>
#include <cli/commands/split.hpp>
#include <experiments/interruption.hpp>

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

class Report;

/// The result of a run, whatever the input was.
struct SplitOutcome {
  std::string source;       ///< a file, or the prefix of several
  std::string description;  ///< the measurements in words
  experiments::Feature feature = experiments::Feature::point;
  experiments::Criterion criterion = experiments::Criterion::maha;
  SplitOptions settings;
  SplitSeries random, by_blocks;
  bool known_noise = true;

  /// Not after an interrupt.
  bool passed() const { return !experiments::trials_of_run.incomplete() && !(by_blocks.pValue() < split_false_alarm); }
};

/// The measurements of one file.
struct FileSplit : SplitOutcome {
  SplitResult result;
  bool covariance_at_matters = false;
  CovarianceAt covariance_at = CovarianceAt::estimated;
  std::vector<std::string> notes;
};

/// One object of a stereo track set.
struct LandmarkSplit {
  std::size_t track = 0;
  SplitResult split;
  MeanAnalysis whole;
  std::optional<Eigen::Vector3d> survey = {};

  double surveyDistance() const;         ///< m; NaN without a survey
  double squaredSurveyDistance() const;  ///< under the covariance of the mean; NaN without one of the two
};

/// Several landmarks, pooled.
struct LandmarkSplits : SplitOutcome {
  std::vector<LandmarkSplit> landmarks;
  std::size_t skipped = 0;  ///< landmarks with too few observations
  bool surveyed = false;

  double surveyRms() const;              ///< m
  double surveySquaredDistance() const;  ///< mean over the landmarks; 3 expected
};

/// Lines for the terminal, the verdict last.
std::string formatSplit(const FileSplit& split);
std::string formatSplit(const LandmarkSplits& split);

JsonObject toJson(const FileSplit& split, const std::string& command_line);
JsonObject toJson(const LandmarkSplits& split, const std::string& command_line);

/// The page with its plots.
void writeSplitReport(const std::string& directory, const std::string& command_line, const FileSplit& split);
void writeSplitReport(const std::string& directory, const std::string& command_line, const LandmarkSplits& split);

/// Parts of these views: the last lines, the fields in JSON and the plots that both have.
std::string splitVerdict(const SplitOutcome& outcome);
/// Its last paragraph in one line: PASSED, FAILED or INTERRUPTED, and what follows from that.
std::string adviceOf(const SplitOutcome& outcome);
JsonObject splitEnvelope(const SplitOutcome& outcome, const std::string& command_line);
void plotSplits(Report& report, const SplitOutcome& outcome);

}  // namespace liestat::cli
