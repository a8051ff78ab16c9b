// The validation of robust search: what is judged, and what fails.

#include <experiments/robust_validation.hpp>
#include <stats/laws.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

namespace liestat::experiments {
namespace {

RobustValidation small(std::size_t trials, std::vector<double> outliers) {
  RobustValidation validation;
  validation.run.trials = trials;
  validation.outliers = std::move(outliers);
  return validation;
}

TEST(RobustValidation, JudgesWhatIsPromised) {
  RobustValidation validation = small(40, {0, 0.4});
  const RobustValidationResult result = validateRobust(validation);
  ASSERT_EQ(result.rows.size(), 16U);
  for (const RobustRow& row : result.rows) {
    EXPECT_TRUE(row.passed.value_or(false)) << name(row.structure) << " " << row.outliers << " " << name(row.verdict);
    EXPECT_TRUE(row.found_passed.value_or(false)) << name(row.structure) << " " << row.outliers;
    EXPECT_GE(row.found, 38U) << "99 % are asked for: P(3 misses of 40) = 0.008";
    // One in a hundred inliers is beyond the threshold; of 40 trials with 60 and more inliers.
    EXPECT_NEAR(row.right, 0.99, 4 * std::sqrt(0.0099 / (40 * 60)) + 0.005);
    EXPECT_EQ(std::isnan(row.wrong), row.outliers == 0);
    if (row.outliers > 0) {
      EXPECT_LT(row.wrong, row.structure == RobustStructure::conic ? 0.05 : 0.01);
    }
    EXPECT_LT(row.draws, 2 * static_cast<double>(row.needed) + 5);
    EXPECT_GE(row.draws, row.outliers > 0 ? 0.7 * static_cast<double>(row.needed) : 1);
  }
  EXPECT_EQ(judgementOf(result).judged(), 32U) << "distances, and whether enough were found";
  ASSERT_EQ(result.thresholds.size(), 2U) << "of one equation a measurement";
  for (const ThresholdRow& row : result.thresholds) {
    EXPECT_GT(row.histogram_found, 0.8);
    EXPECT_NEAR(row.histogram_mean, 2.6, 0.6);
    EXPECT_GT(row.moments_found, 0.9);
    EXPECT_NEAR(row.moments_median, 4.42, 0.8);
  }
}

TEST(RobustValidation, CuttingErrorsWidensTheErrorOfTheEstimate) {
  for (const RobustRow& row : validateRobust(small(1, {0})).rows) {
    EXPECT_NEAR(row.cut_factor, row.structure == RobustStructure::conic ? 1.081 : 1.049, 0.001);
  }
  // The mean of 200 normal numbers without those beyond t: the variance of its error over that which those kept promise.
  constexpr int trials = 6000, n = 200;
  const double t = std::sqrt(chiSquaredQuantile(0.99, 1));
  double ratio = 0;
  for (int trial = 0; trial < trials; ++trial) {
    CounterRng rng(3, static_cast<std::uint64_t>(trial));
    std::array<double, n> x;
    for (double& one : x) one = rng.normal();
    double mean = 0, kept = 0;
    for (int pass = 0; pass < 10; ++pass) {
      double sum = 0;
      kept = 0;
      for (const double one : x) {
        const bool inside = std::abs(one - mean) < t;
        sum += inside ? one : 0, kept += inside ? 1 : 0;
      }
      mean = sum / kept;
    }
    ratio += mean * mean * kept / trials;
  }
  // Three standard errors: without the factor it would be 1.
  EXPECT_NEAR(ratio, 1.081, 3 * std::sqrt(2. / trials) * 1.081);
}

TEST(RobustValidation, MoreOutliersAreShownAndNotJudged) {
  RobustValidation validation = small(4, {0.6});
  validation.structures = {RobustStructure::homography};
  validation.scores = {RobustScore::truncated_cost};
  const RobustValidationResult result = validateRobust(validation);
  ASSERT_EQ(result.rows.size(), 1U);
  EXPECT_FALSE(result.rows[0].passed || result.rows[0].found_passed);
  EXPECT_FALSE(judgementOf(result).passed()) << "nothing was judged";
}

TEST(RobustValidation, AWrongNoiseFails) {
  RobustValidation validation = small(60, {0.2});
  validation.scores = {RobustScore::truncated_cost};
  // 5 % of errors 1.3 times as large are beyond the threshold: the structure is found, and distances are too large.
  validation.noise_factor = 1.3;
  RobustValidationResult result = validateRobust(validation);
  for (const RobustRow& row : result.rows) {
    EXPECT_FALSE(row.passed.value_or(true)) << name(row.structure);
    EXPECT_EQ(row.verdict, ValidationVerdict::index_too_large) << name(row.structure);
  }
  EXPECT_GE(judgementOf(result).failed(), 2U);
  // 20 % (one equation) and 31 % (two) of errors twice as large are: nine tenths of the inliers are never kept.
  validation.noise_factor = 2;
  result = validateRobust(validation);
  for (const RobustRow& row : result.rows) EXPECT_FALSE(row.found_passed.value_or(true)) << name(row.structure);
  EXPECT_GE(judgementOf(result).failed(), 2U);
}

TEST(RobustValidation, IsTheSameForAnyNumberOfThreads) {
  RobustValidation validation = small(8, {0.4});
  validation.run.threads = 1;
  const RobustValidationResult one = validateRobust(validation);
  validation.run.threads = 2;
  const RobustValidationResult two = validateRobust(validation);
  ASSERT_EQ(one.rows.size(), two.rows.size());
  for (std::size_t i = 0; i < one.rows.size(); ++i) {
    EXPECT_EQ(one.rows[i].report.index, two.rows[i].report.index);
    EXPECT_EQ(one.rows[i].draws, two.rows[i].draws);
  }
  EXPECT_EQ(one.thresholds[0].moments_median, two.thresholds[0].moments_median);
}

// The figures of Viéville, Lingrand and Gaspard: tests/paper/ has their numbers, here is that the page has them.
TEST(RobustFigures, AreThoseOfTheReport) {
  RobustValidation validation = small(2, {0.3});
  validation.structures = {RobustStructure::conic};
  EXPECT_TRUE(validateRobust(validation).figures.densities.empty());
  validation.figures = true;
  const VievilleFigures figures = validateRobust(validation).figures;

  ASSERT_EQ(figures.densities.size(), 5U);
  double highest = 0;
  std::string sharpest;
  for (const FigureCurve& curve : figures.densities) {
    if (curve.y.front() > highest) highest = curve.y.front(), sharpest = curve.name;
  }
  EXPECT_EQ(sharpest, "v = 10");

  ASSERT_EQ(figures.biases.size(), 30U);
  for (const StewartRow& row : figures.biases) {
    // Only overlapping modes bias a score, and at 80 % of outliers relevance (docs/theory/constrained.md: -1.2 ± 1.5).
    const double bias = row.score == "R" && row.e0 == 0.8 ? -1.2 : 0;
    if (row.delta != 10 && row.delta != 20) {
      EXPECT_NEAR(row.mean, bias, 0.3 + 4 * row.deviation / std::sqrt(50.)) << row.score << " " << row.e0;
    }
  }

  ASSERT_EQ(figures.relevance.size(), 2U);
  for (const FigureCurve& curve : figures.relevance) {
    EXPECT_TRUE(std::is_sorted(curve.y.begin(), curve.y.end())) << curve.name;
    EXPECT_GT(curve.y.back(), 0.3) << "of 0.4, the share of the conic";
  }

  ASSERT_EQ(figures.phi.size(), 4U);
  const double printed[] = {0.25, 0.38, 0.47, 0.54, 0.60, 0.64, 0.68};  // the diagonal of the report's matrix
  for (std::size_t d = 0; d < std::size(printed); ++d) {
    EXPECT_NEAR(figures.phi[2].y[d], printed[d], 0.0101) << figures.phi[2].name;
    EXPECT_LT(figures.phi[3].y[d], figures.phi[2].y[d]) << "P = 0.9 is the lower curve";
  }
}

}  // namespace
}  // namespace liestat::experiments
