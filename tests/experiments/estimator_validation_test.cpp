// The validation of constrained estimation: what is judged, and that a wrong noise fails.

#include <experiments/estimator_validation.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat::experiments {
namespace {

EstimatorValidation small(std::size_t trials) {
  EstimatorValidation validation;
  validation.run.trials = trials;
  return validation;
}

TEST(EstimatorValidation, JudgesWhatIsPromised) {
  const std::vector<EstimatorRow> rows = validateEstimator(small(200));
  ASSERT_EQ(rows.size(), 21U);
  std::size_t judged = 0;
  for (const EstimatorRow& row : rows) {
    EXPECT_EQ(row.report.trials, 200U);
    EXPECT_EQ(row.report.failures, 0U) << name(row.experiment);
    const bool curved = row.experiment == EstimatorExperiment::conic && row.sigma > 0.005;
    EXPECT_EQ(row.passed.has_value(), !curved) << "curvature counts: shown beside the prototype's figures";
    EXPECT_TRUE(row.passed.value_or(true))
        << name(row.experiment) << " " << name(row.quantity) << ": " << name(row.verdict);
    judged += row.passed.has_value();
    // Four standard errors of the law; curvature is some 7 % of the index at most.
    EXPECT_NEAR(row.report.index, row.report.dof, 4 * std::sqrt(2. * row.report.dof / 200) + 0.08 * row.report.dof)
        << name(row.experiment) << " " << name(row.quantity);
    if (std::isfinite(row.note_index)) {
      EXPECT_NEAR(row.report.index, row.note_index, 4 * std::sqrt(2.2 * row.report.dof / 200)) << name(row.experiment);
    }
    EXPECT_EQ(std::isfinite(row.covariance_deviation), row.quantity == EstimatorQuantity::corrected_point);
  }
  EXPECT_EQ(judgementOf(rows).judged(), judged);
  EXPECT_EQ(judged, 17U);
}

TEST(EstimatorValidation, AWrongNoiseFails) {
  // Distances are 1.44 and 0.64 times as large.
  for (const double factor : {1.2, 0.8}) {
    EstimatorValidation validation = small(400);
    validation.noise_factor = factor;
    validation.experiments = {EstimatorExperiment::conic, EstimatorExperiment::rotation,
                              EstimatorExperiment::homography};
    for (const EstimatorRow& row : validateEstimator(validation)) {
      if (!row.promise) continue;
      EXPECT_FALSE(row.passed.value_or(true)) << name(row.experiment) << " " << name(row.quantity);
      EXPECT_EQ(row.verdict, factor > 1 ? ValidationVerdict::index_too_large : ValidationVerdict::index_too_small);
    }
  }
}

TEST(EstimatorValidation, IsTheSameForAnyNumberOfThreads) {
  EstimatorValidation validation = small(50);
  validation.experiments = {EstimatorExperiment::corrected_points, EstimatorExperiment::fundamental};
  validation.run.threads = 1;
  const std::vector<EstimatorRow> one = validateEstimator(validation);
  validation.run.threads = 2;
  const std::vector<EstimatorRow> two = validateEstimator(validation);
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].report.index, two[i].report.index);
}

}  // namespace
}  // namespace liestat::experiments
