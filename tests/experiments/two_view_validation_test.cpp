// The simulated motions between two images: what is judged, and the rules of choice.

#include <experiments/two_view_rules.hpp>
#include <experiments/two_view_validation.hpp>

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace liestat::experiments {
namespace {

TwoViewValidation small(std::size_t trials) {
  TwoViewValidation validation;
  validation.run.trials = trials;
  return validation;
}

TEST(TwoViewValidation, JudgesEveryMotion) {
  const TwoViewValidationResult result = validateTwoView(small(4));
  EXPECT_EQ(result.choices.size(), 9U);
  EXPECT_EQ(result.rows.size(), 8U) << "no motion has no parameter";
  for (const TwoViewChoice& choice : result.choices) {
    std::size_t sum = 0;
    for (const std::size_t count : choice.chosen) sum += count;
    EXPECT_EQ(sum, 4U);
    EXPECT_TRUE(choice.passed.value_or(false)) << name(choice.truth);
  }
  EXPECT_TRUE(result.average_passed.value_or(false));
  EXPECT_EQ(judgementOf(result).judged(), 8U + 9U + 1U);
  EXPECT_TRUE(judgementOf(result).passed());
}

TEST(TwoViewValidation, OptionalModelsAreRowsOfTheirOwn) {
  TwoViewValidation validation = small(4);
  validation.motions = {TwoViewMotion::retinal_translation, TwoViewMotion::affine, TwoViewMotion::rotation_zoom};
  const TwoViewValidationResult result = validateTwoView(validation);
  ASSERT_EQ(result.choices.size(), 3U);
  EXPECT_EQ(result.rows.size(), 3U);
  EXPECT_EQ(result.average(), 1) << "of the default lattice's motions alone";
  EXPECT_FALSE(result.average_passed.has_value());
}

TEST(TwoViewValidation, IsTheSameForAnyNumberOfThreads) {
  TwoViewValidation validation = small(6);
  validation.motions = {TwoViewMotion::essential};
  validation.run.threads = 1;
  const TwoViewValidationResult one = validateTwoView(validation);
  validation.run.threads = 2;
  const TwoViewValidationResult two = validateTwoView(validation);
  EXPECT_EQ(one.rows[0].report.index, two.rows[0].report.index);
  EXPECT_EQ(one.choices[0].chosen, two.choices[0].chosen);
}

TEST(TwoViewValidation, TooManyOutliersFail) {
  // Six inliers do not determine a fundamental matrix: the most general model fits what else there is, and its estimate is
  // far off.
  TwoViewValidation validation = small(20);
  validation.motions = {TwoViewMotion::fundamental};
  validation.matches = 60;
  validation.outliers = 0.9;
  const TwoViewValidationResult result = validateTwoView(validation);
  EXPECT_FALSE(result.rows[0].passed.value_or(true));
  EXPECT_FALSE(result.average_passed.has_value()) << "an average of one motion is none";
  EXPECT_FALSE(judgementOf(result).passed());
}

TEST(TwoViewRules, AnInterruptLeavesTheFirstTrials) {
  TrialsOfRun& run = trials_of_run;
  run.stop = false, run.planned = 0, run.done = 0;
  TwoViewRuleComparison comparison;
  comparison.matches = 40, comparison.run = {.trials = 40, .threads = 1};
  // Among the trials of the first motion, a few of which are under way together.
  const std::vector<TwoViewRuleRow> rows =
      compareTwoViewRules(comparison, [&](std::uint64_t, std::uint64_t) { run.stop = true; });
  ASSERT_TRUE(run.incomplete());
  const std::size_t done = run.done;
  EXPECT_EQ(run.planned, 360U);
  EXPECT_LT(done, 40U);
  // The same as those of a shorter run, which is stopped after its first motion.
  run.stop = false, run.planned = 0, run.done = 0, comparison.run = {.trials = done, .threads = 2};
  const std::vector<TwoViewRuleRow> shorter = compareTwoViewRules(
      comparison,
      [&](std::uint64_t now, std::uint64_t all) { run.stop = now >= all / default_two_view_motions.size(); });
  ASSERT_EQ(rows.size(), shorter.size());
  for (std::size_t r = 0; r < rows.size(); ++r) {
    EXPECT_EQ(rows[r].trials, TwoViewRuleRow::OfMotions{done});
    EXPECT_EQ(rows[r].trials, shorter[r].trials);
    EXPECT_EQ(rows[r].right, shorter[r].right) << rows[r].rule;
    EXPECT_EQ(rows[r].worst(), 0U);
  }
  run.stop = true, run.planned = 0, run.done = 0;
  EXPECT_TRUE(compareTwoViewRules(comparison).empty());
  run.stop = false;
}

}  // namespace
}  // namespace liestat::experiments
