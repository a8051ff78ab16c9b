#pragma once

#include <cli/show/json.hpp>
#include <fusion/convention_diagnosis.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// The text, JSON and page of `liestat doctor`.
struct DiagnosisOutput {
  std::vector<std::string> files;  ///< estimates, or the graph
  std::string reference;           ///< empty without truth
  std::string mode;                ///< diagnosis, chain, plan
  std::string what;                ///< "poses", "edges", "runs at one time"
  std::vector<std::string> notes;  ///< on the files
  MatrixStructure structure;
  std::optional<ConventionDiagnosis> diagnosis;
  std::optional<ChainDiagnosis> chain;
  std::vector<PlanRow> plan;
};

/// The exit code: 0 identified and consistent, 4 undecidable, 5 inconsistent or none.
int exitCodeOf(const DiagnosisOutput& output);

std::string formatDiagnosis(const DiagnosisOutput& output);
void setDiagnosis(JsonObject& object, const DiagnosisOutput& output);

}  // namespace liestat::cli
