// The verdict of the simulated means on what the documentation promises.

#include <experiments/means_validation.hpp>

#include <gtest/gtest.h>

#include <support/means_validations.hpp>

#include <vector>

namespace liestat::experiments {
namespace {

// Trial 117 has a datum that is known to 3 mm along one axis. At its lever arm, known to 2.5 m, the mean's orientation,
// known to 0.03 rad, moves that axis by centimetres, which no covariance of first order contains: the truth is at a
// squared distance of 371 under it, with a likelihood ratio of 2.8. A noise of which some variance is U(0, 1) has no
// bound on such distances.
TEST(MeansValidation, aCovarianceOfFirstOrderMayBeFarTooSmallNowAndThen) {
  for (const MeansRow& row : validateMeans(liestat_test::mahaOnFrames())) {
    if (!row.method.corrected) continue;
    EXPECT_GT(row.report.mu2.back(), 300) << "this seed shows it no more: find another";
    EXPECT_GT(row.report.index, 7.5);
    EXPECT_EQ(row.report.failures, 0U);
    EXPECT_TRUE(row.passed.value_or(false)) << row.report;
    ASSERT_TRUE(row.promise);
    // One in 200 is no evidence; a promise of none would be broken.
    ValidationTolerance all_averaged = *row.promise;
    all_averaged.tail = 0;
    EXPECT_FALSE(row.report.passed(run_false_alarm, all_averaged));
  }
}

TEST(MeansValidation, anyNumberOfTrialsPasses) {
  for (const std::size_t trials : {1U, 3U, 10U, 40U}) {
    MeansValidation validation;
    validation.n = {5, 10};
    validation.run.trials = trials;
    validation.run.seed = 3;
    for (const MeansRow& row : validateMeans(validation)) EXPECT_TRUE(row.passed.value_or(true)) << name(row.verdict);
  }
}

TEST(MeansValidation, whatIsJudgedIsCounted) {
  MeansValidation validation = liestat_test::mahaOnFrames();
  validation.run.trials = 20;
  validation.n = {5, 10};
  const std::vector<MeansRow> rows = validateMeans(validation);
  for (const MeansRow& row : rows) {
    // The domain of MAHA on frames begins at ten measurements; the report's formulas are not judged.
    EXPECT_EQ(row.passed.has_value(), row.method.corrected && row.experiment.n == 10);
    EXPECT_EQ(row.histogram.size(), 30U);
  }
  EXPECT_EQ(judgementOf({rows, {}}).judged(), 2U);
  EXPECT_EQ(judgementOf({rows, {}}).failed(), 0U);
}

}  // namespace
}  // namespace liestat::experiments
