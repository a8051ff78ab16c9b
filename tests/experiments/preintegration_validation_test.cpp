// The simulated preintegration: what is judged.

#include <experiments/preintegration_validation.hpp>

#include <gtest/gtest.h>

#include <vector>

namespace liestat::experiments {
namespace {

TEST(PreintegrationValidation, JudgesWhatIsPromised) {
  PreintegrationValidation validation;
  validation.run.trials = 200;
  validation.windows = {0.1};
  validation.noises = {1, 100};
  const std::vector<PreintegrationRow> rows = validatePreintegration(validation);
  ASSERT_GE(rows.size(), 3U * 2 + 5);
  std::size_t judged = 3;
  for (const PreintegrationRow& row : rows) {
    if (row.check == PreintegrationCheck::recording) {
      judged += row.passed ? 1 : 0;
      EXPECT_TRUE(row.passed.value_or(2 * row.report.failures > row.report.trials)) << row.scene;
      continue;
    }
    EXPECT_EQ(row.report.trials, 200U);
    EXPECT_EQ(row.report.dof, row.check == PreintegrationCheck::motion_and_bias ? 15 : 9);
    EXPECT_EQ(row.passed.has_value(), row.noise == 1) << "promised up to ten times the sensor's noise";
    EXPECT_TRUE(row.passed.value_or(true)) << name(row.verdict);
  }
  EXPECT_EQ(judgementOf(rows).judged(), judged);
}

}  // namespace
}  // namespace liestat::experiments
