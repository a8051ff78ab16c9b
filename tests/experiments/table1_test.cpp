// The paper's table of cases, as corrected, and its two scenes with two solutions.

#include <experiments/closed_form_cases.hpp>
#include <experiments/table1.hpp>
#include <experiments/two_solutions.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>

namespace liestat::experiments {
namespace {

TEST(Table1, hasEveryCaseOnce) {
  std::multiset<std::string> exact, noisy;
  std::set<char> letters;
  for (const Table1Correction& c : table1Corrections()) letters.insert(c.letter);
  std::set<char> used;
  for (const Table1Entry& entry : table1Entries()) {
    for (const bool with_noise : {false, true}) {
      for (const auto& [case_name, corrections] : with_noise ? entry.noisy : entry.exact) {
        (with_noise ? noisy : exact).insert(case_name);
        used.insert(corrections.begin(), corrections.end());
      }
    }
  }
  EXPECT_EQ(used, letters);
  EXPECT_EQ(exact.size(), closedFormCases().size());
  EXPECT_EQ(noisy.size(), noisyClosedFormCases().size());
  for (const ClosedFormCase& c : closedFormCases()) EXPECT_EQ(exact.count(c.name), 1U) << c.name;
  for (const NoisyClosedFormCase& c : noisyClosedFormCases()) EXPECT_EQ(noisy.count(c.name), 1U) << c.name;
}

TEST(Table1, isRecognisedAsCorrected) {
  const auto rows = recogniseTable1({.trials = 16, .seed = 3});
  EXPECT_EQ(rows.size(), closedFormCases().size() + noisyClosedFormCases().size());
  for (const Table1Row& row : rows) {
    EXPECT_TRUE(*row.passed) << row.name;
    EXPECT_EQ(row.solutions[0] + row.solutions[1] + row.solutions[2], 16U);
    if (!row.noisy) {
      EXPECT_EQ(row.null_right, 16U) << row.name;
    }
  }
  // Where the paper says two, there are scenes with one.
  const auto constant =
      std::find_if(rows.begin(), rows.end(), [](const Table1Row& row) { return row.name == "constant acceleration"; });
  EXPECT_GT(constant->solutions[0], 0U);
  EXPECT_GT(constant->solutions[1], 0U);
}

TEST(Scene, hasTwoSolutions) {
  for (const std::uint64_t seed : {1U, 77U}) {
    const auto first = twoSolutions(1, seed), second = twoSolutions(2, seed);
    ASSERT_TRUE(first && second);
    EXPECT_EQ(first->scene.times.size(), 4U);
    EXPECT_EQ(first->scene.features.size(), 1U);
    EXPECT_EQ(second->scene.times.size(), 7U);
    EXPECT_EQ(second->scene.features.size(), 3U);
    for (const TwoSolutions* found : {&*first, &*second}) {
      EXPECT_EQ(found->result.solutions.size(), 2U);
      const ClosedFormSolution& truth = found->result.solutions[found->truth];
      EXPECT_LE((truth.velocity - found->scene.velocity).norm(), 1e-7);
      // The feature's first bearing is that of both.
      const auto &a = found->result.solutions[0].features[0], &b = found->result.solutions[1].features[0];
      EXPECT_LE(a.cross(b).norm(), 1e-7 * a.norm() * b.norm());
      EXPECT_GT(a.dot(b), 0);
    }
    // All features of the second figure by the same factor.
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(second->result.solutions[1].features[i].norm() / second->result.solutions[0].features[i].norm(),
                  measuredScale(*second), 1e-7);
    }
  }
}

}  // namespace
}  // namespace liestat::experiments
