#pragma once

#include <cli/show/json.hpp>
#include <fusion/trajectories.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// One estimate as `liestat evaluate` found it.
struct EvaluatedEstimate {
  std::string name;       ///< of the file
  std::size_t poses = 0;  ///< in the file
  bool by_time = true;
  std::vector<double> times;  ///< of the matched poses, s; numbers of rows where there are none
  std::vector<MatchedPose> matched;
  std::string convention;        ///< of its covariances, in words; empty if it has none
  Alignment alignment;           ///< of APE and RPE
  std::vector<double> ape, rpe;  ///< in the unit below
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  ErrorStatistics ape_statistics, rpe_statistics;
  std::string ape_title, rpe_title;  ///< as evo writes them, where it could have computed the same
  Alignment weighted;                ///< of the verdict
  Consistency consistency;
  std::optional<RelativeConsistency> relative;
  std::vector<std::string> notes;

  bool hasCovariances() const { return !convention.empty(); }
};

/// The verdict on the covariances of an estimate, in a sentence, and whether they are to be trusted (nothing: no verdict).
struct EvaluationVerdict {
  std::optional<bool> good;
  std::string text;
  std::vector<std::string> causes;
};
EvaluationVerdict verdictOf(const EvaluatedEstimate& e);

/// The result of `liestat evaluate`.
struct EvaluationOutput {
  std::string reference;
  std::size_t reference_poses = 0;
  bool reference_has_covariances = false;
  std::string association, pairs_model;  ///< in words; the model is empty if there is none
  std::string ape_unit, rpe_unit;
  std::vector<EvaluatedEstimate> estimates;
  std::vector<std::string> failed;  ///< conditions of --fail-if that hold
};

/// The figures that --fail-if knows, by name; NaN where one does not apply.
std::vector<std::pair<std::string, double>> figuresOf(const EvaluatedEstimate& e);

std::string formatEvaluation(const EvaluationOutput& output);
void setEvaluation(JsonObject& object, const EvaluationOutput& output);
void writeEvaluationReport(const std::string& directory, const std::string& command_line,
                           const EvaluationOutput& output);

/// evo's result file: the archive of APE, or of RPE.
std::string evoResult(const EvaluationOutput& output, const EvaluatedEstimate& e, bool relative,
                      const std::string& path);

}  // namespace liestat::cli
