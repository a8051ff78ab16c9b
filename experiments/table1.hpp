#pragma once

#include <experiments/cell_run.hpp>
#include <experiments/judgement.hpp>
#include <fusion/init/closed_form_types.hpp>

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace liestat::experiments {

/// How many solutions a status stands for.
enum class SolutionCount { one, two, infinite };
SolutionCount solutionsOf(FusionStatus status);

/// A row of Martinelli's Table 1 (2012), or what his text says beside it.
struct Table1Entry {
  const char* cases;  ///< the motion, images n and features N
  const char* paper;  ///< the paper's number of solutions
  /// Names of the cases of experiments/closed_form_cases.hpp that stand for it, each with the letters of the
  /// corrections that concern it.
  std::vector<std::pair<std::string, std::string>> exact, noisy;
};
const std::vector<Table1Entry>& table1Entries();

/// Where the paper is corrected, or something is added to it: a letter and what is true.
struct Table1Correction {
  char letter;
  bool corrects;  ///< true: a correction that the paper names; false: an addition
  const char* text;
};
const std::vector<Table1Correction>& table1Corrections();

/// The outcome of one case: the statuses and solutions that its scenes were recognised to have.
struct Table1Row {
  std::size_t entry = 0;  ///< index in table1Entries()
  std::string name, corrections;
  bool noisy = false;
  std::size_t images = 0, features = 0, scenes = 0;
  bool bias = false;
  int null = -1;               ///< dimension of the null space as it must be; exact data only
  std::size_t null_right = 0;  ///< scenes in which it was found
  std::array<std::size_t, 3> solutions = {};
  std::vector<std::pair<FusionStatus, std::size_t>> statuses;  ///< by number of scenes
  std::vector<FusionStatus> expected;
  std::size_t wrong = 0;       ///< scenes that came out otherwise than corrected
  std::optional<bool> passed;  ///< always there
};

/// Statuses and in how many scenes they were, as fields.
struct Table1Statuses {
  const Table1Row* row = nullptr;
};
template <class V>
void describe(V& v, const Table1Statuses& statuses) {
  if (statuses.row == nullptr) return;
  for (const auto& [status, count] : statuses.row->statuses) v(std::string(name(status)).c_str(), count, "scenes");
}
template <class V>
void describe(V& v, const Table1Row& row) {
  const Table1Entry& entry = table1Entries()[row.entry];
  v("row", row.entry + 1)("cases", entry.cases)("paper", entry.paper)("case", row.name);
  v("corrections", row.corrections)("data", row.noisy ? "noise" : "exact");
  v("images", row.images)("features", row.features)("bias", row.bias)("scenes", row.scenes);
  v("null", row.noisy ? std::nullopt : std::optional(row.null), "dimension of the null space as it must be");
  v("null_right", row.noisy ? std::nullopt : std::optional(row.null_right), "scenes in which it was found");
  v("one_solution", row.solutions[0])("two_solutions", row.solutions[1])("infinite_solutions", row.solutions[2]);
  v("recognised", Table1Statuses{&row});
  std::vector<std::string> expected;
  for (const FusionStatus status : row.expected) expected.push_back(name(status));
  v("expected", expected)("otherwise", row.wrong, "scenes")("passed", row.passed);
}

/// Probability that a scene drawn at random is so near to another case that it counts as that, with exact data.
inline constexpr double table1_near_another_case = 1e-3;
/// Recognises all cases of the table in so many scenes each; the same for any number of threads.
std::vector<Table1Row> recogniseTable1(const RunSize& size, const RunProgress& progress = {});

/// The promise on each case: it comes out as the corrected table says.
Judgement judgementOf(const std::vector<Table1Row>& rows);

}  // namespace liestat::experiments
