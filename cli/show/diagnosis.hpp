#pragma once

#include <cli/show/json.hpp>
#include <cli/show/pose_errors.hpp>
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

/// The poses that were diagnosed, for the plots.
struct DiagnosedFile {
  std::vector<DiagnosedPose> poses;
  TimesOfPoses times;
  AlignmentModel alignment = AlignmentModel::none;
  Convention
      assumed;  ///< in which the file would be read without a diagnosis: the library's own, as far as the format allows
};

/// The exit code: 0 identified and consistent, 4 undecidable, 5 inconsistent or none.
int exitCodeOf(const DiagnosisOutput& output);

std::string formatDiagnosis(const DiagnosisOutput& output);
void setDiagnosis(JsonObject& object, const DiagnosisOutput& output);
void writeDiagnosisReport(const std::string& directory, const std::string& command_line, const DiagnosisOutput& output,
                          const DiagnosedFile& file);

/// The verdict in one line. Empty for a plan.
std::string verdictOf(const DiagnosisOutput& output);

}  // namespace liestat::cli
