#pragma once

#include <experiments/judged_report.hpp>
#include <fusion/init/closed_form_types.hpp>

#include <array>
#include <cstdint>
#include <functional>
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
  std::vector<std::pair<const char*, const char*>> exact, noisy;
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

/// Probability that a scene drawn at random is so near to another case that it counts as that, with exact data.
inline constexpr double table1_near_another_case = 1e-3;
/// Recognises all cases of the table in so many scenes each; the same for any number of threads.
std::vector<Table1Row> recogniseTable1(std::size_t scenes, std::uint64_t seed, int threads,
                                       const std::function<void(std::uint64_t done, std::uint64_t all)>& progress = {});

}  // namespace liestat::experiments
