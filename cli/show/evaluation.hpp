#pragma once

#include <report/json.hpp>
#include <fusion/evaluate_types.hpp>

#include <array>
#include <cstddef>
#include <string>
#include <vector>

namespace liestat::cli {

/// One estimate as `liestat evaluate` shows it.
struct EvaluatedEstimate {
  std::string name;  ///< name of the file, with as much of its path as tells it from the others
  TrajectoryEvaluation evaluation;
};
template <class V>
void describe(V& v, const EvaluatedEstimate& e) {
  v("file", e.name);
  describe(v, e.evaluation);
}

/// The result of `liestat evaluate`: at least one estimate.
struct EvaluationOutput {
  std::string reference;
  bool reference_has_covariances = false;
  std::vector<std::string> reference_notes;  ///< on its reading
  std::vector<EvaluatedEstimate> estimates;
  std::vector<std::string> failed;  ///< conditions of --fail-if that hold

  /// Fields that all estimates have in common.
  const TrajectoryEvaluation& setting() const { return estimates.front().evaluation; }
};
template <class V>
void describe(V& v, const EvaluationOutput& output) {
  v("reference", output.reference)("reference_notes", output.reference_notes, "on its reading");
  describeSetting(v, output.setting());
  v("estimates", output.estimates)("failed", output.failed);
}

std::string formatEvaluation(const EvaluationOutput& output);
/// A row for each estimate with the figures that --fail-if compares, as CSV.
std::string evaluationCsv(const EvaluationOutput& output);
void writeEvaluationReport(const std::string& directory, const std::string& command_line,
                           const EvaluationOutput& output);

}  // namespace liestat::cli
