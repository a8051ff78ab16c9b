// The validation of hand-eye calibration: what is judged, the figures of an independent prototype, and that a wrong
// noise fails.

#include <experiments/hand_eye_validation.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat::experiments {
namespace {

HandEyeValidation small(std::size_t trials, std::vector<HandEyeExperiment> experiments) {
  HandEyeValidation validation;
  validation.run.trials = trials;
  validation.experiments = std::move(experiments);
  return validation;
}

TEST(HandEyeValidation, ErrorsAreThoseOfTheNote) {
  const std::size_t trials = 50;
  const auto rows = validateHandEye(small(trials, {HandEyeExperiment::accuracy}));
  ASSERT_EQ(rows.size(), 24U);
  for (const HandEyeRow& row : rows) {
    ASSERT_TRUE(row.passed.has_value()) << label(row);
    EXPECT_TRUE(*row.passed) << label(row) << ": " << name(row.verdict);
    EXPECT_EQ(row.report.failures, 0U);
    if (row.fit) continue;
    // Four standard errors of both runs together, 300 trials of the prototype.
    const double both = std::sqrt(1 + static_cast<double>(trials) / 300);
    if (std::isfinite(row.note_rotation)) {
      EXPECT_NEAR(row.rms_rotation, row.note_rotation, 4 * both * row.rms_rotation_error) << label(row);
      EXPECT_NEAR(row.rms_translation, row.note_translation, 4 * both * row.rms_translation_error) << label(row);
    }
    EXPECT_NEAR(row.report.index, 6, 4 * std::sqrt(12. / trials) + 0.2) << label(row);
    EXPECT_NEAR(row.chi2_per_dof, 1, 4 * std::sqrt(2. / (6. * row.pairs - 12) / trials) + 0.02) << label(row);
  }
}

TEST(HandEyeValidation, MotionsAndWrongPairs) {
  const auto rows = validateHandEye(small(20, {HandEyeExperiment::motions, HandEyeExperiment::outliers}));
  ASSERT_EQ(rows.size(), 16U + 12U);
  for (const HandEyeRow& row : rows) {
    EXPECT_EQ(row.right, 20U) << label(row);
    EXPECT_TRUE(row.right_passed.value_or(false)) << label(row);
    EXPECT_TRUE(row.passed.value_or(true)) << label(row) << ": " << name(row.verdict);
  }
  EXPECT_EQ(judgementOf(rows).failed(), 0U);
}

TEST(HandEyeValidation, RelativeMotionsOfAbsolutePosesHaveTooSmallACovariance) {
  const auto rows = validateHandEye(small(60, {HandEyeExperiment::formulations}));
  ASSERT_EQ(rows.size(), 10U);
  // NEES of the prototype with 8 and 20 poses (docs/theory/hand_eye.md, section 2): consecutive 8.2, 9.5; to the first
  // 12.5, 25.6; all 24.7, 60.2; scaled 6.2, 6.0.
  const double note[] = {6, 8.2, 12.5, 24.7, 6.2, 6, 9.5, 25.6, 60.2, 6.0};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_FALSE(rows[i].passed.has_value());
    // Distances of k = 6 have a relative standard error of sqrt(2/6/trials); those of correlated pairs twice that.
    EXPECT_NEAR(rows[i].report.index, note[i], 4 * 2 * note[i] * std::sqrt(2. / 6 / 60)) << label(rows[i]);
    if (rows[i].formulation == HandEyeFormulation::all_pairs) {
      EXPECT_GT(rows[i].report.index, 15);
      // The residuals don't show it.
      EXPECT_LT(rows[i].chi2_per_dof, 1.02);
      EXPECT_GT(rows[i].chi2_per_dof, 0.75);
    }
  }
}

TEST(HandEyeValidation, AWrongNoiseFails) {
  for (const double factor : {1.3, 0.75}) {
    HandEyeValidation validation = small(60, {HandEyeExperiment::accuracy});
    validation.noise_factor = factor;
    std::size_t failed = 0, judged = 0;
    for (const HandEyeRow& row : validateHandEye(validation)) {
      ++judged, failed += !row.passed.value_or(true);
      if (row.fit) {
        EXPECT_FALSE(row.passed.value_or(true)) << label(row);
      }
    }
    EXPECT_GE(failed, judged / 2) << factor;
  }
}

TEST(HandEyeValidation, IsTheSameForAnyNumberOfThreads) {
  HandEyeValidation validation = small(12, {HandEyeExperiment::motions});
  validation.run.threads = 1;
  const auto one = validateHandEye(validation);
  validation.run.threads = 2;
  const auto two = validateHandEye(validation);
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].report.index, two[i].report.index);
    EXPECT_EQ(one[i].rms_rotation, two[i].rms_rotation);
  }
}

}  // namespace
}  // namespace liestat::experiments
