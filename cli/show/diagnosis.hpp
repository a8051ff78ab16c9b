#pragma once

#include <fusion/convention_diagnosis_types.hpp>

#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// The text, JSON and page of `liestat doctor`.
struct DiagnosisOutput {
  std::vector<std::string> files;  ///< estimates, or the graph
  std::string reference;           ///< empty without truth
  CovarianceDiagnosis result;
};
template <class V>
void describe(V& v, const DiagnosisOutput& output) {
  v("files", output.files)("reference", output.reference.empty() ? std::nullopt : std::optional(output.reference));
  describe(v, output.result);
}

std::string formatDiagnosis(const DiagnosisOutput& output);
/// `readings`: the file in the convention that is assumed without a diagnosis, then in the best one if it is another.
void writeDiagnosisReport(const std::string& directory, const std::string& command_line, const DiagnosisOutput& output,
                          const std::vector<ConventionReading>& readings);

}  // namespace liestat::cli
