#include <lie/rn.hpp>
#include <lie/so3.hpp>
#include <stats/random.hpp>
#include <stats/sampling.hpp>
#include <stats/split_validation.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace {

using namespace liestat;
using Point = Eigen::Vector3d;

/// Noise of unit covariance, of which `shared` of the variance is common to each of `blocks` stretches of time.
std::vector<Point> measurements(std::size_t n, std::size_t blocks, double shared, std::uint64_t seed) {
  std::vector<Point> list;
  Point common = Point::Zero();
  CounterRng rng(seed, 0);
  for (std::size_t i = 0; i < n; ++i) {
    if (i * blocks % n < blocks) common = rng.normalVector<3>();
    const Point own = rng.normalVector<3>();
    list.push_back(Point(1, 2, 3) + std::sqrt(shared) * common + std::sqrt(1 - shared) * own);
  }
  return list;
}

TEST(SplitValidation, HalvesInTimeAreThoseOfTheTimes) {
  // Times that run backwards: the second half of the rows is the first half in time.
  const std::vector<Point> points{{3, 0, 0}, {5, 0, 0}, {0, 1, 0}, {0, 3, 0}};
  const std::vector<Point::Scalar> weights(4, 1.0);
  const std::vector<SquareOf<Point>> noise(4, SquareOf<Point>::Identity());
  const auto v =
      validateMeanBySplitting(SerialExecutor{}, points, weights, noise, {4, 3, 2, 1}, {.splits = 3, .blocks = 2});
  EXPECT_TRUE(v.first.result.estimate.mean.isApprox(Point(0, 2, 0)));
  EXPECT_TRUE(v.second.result.estimate.mean.isApprox(Point(4, 0, 0)));
  EXPECT_TRUE(v.merged.result.estimate.mean.isApprox(Point(2, 1, 0)));
  // Both halves have the covariance I/2: the squared distance is 16 + 4.
  EXPECT_NEAR(v.squared_distance, 20, 1e-12);
  EXPECT_NEAR(v.p_value, chiSquaredSurvival(20, 3), 1e-12);
  EXPECT_EQ(v.law.dof(), 3);
  EXPECT_FALSE(v.law.is_hotelling());
  EXPECT_TRUE(lawOfHalves<Point>(4, false).is_hotelling());
}

TEST(SplitValidation, HalvesByHand) {
  // Four points about (0, 0) and four about (3, 0), deviation diag(2/3): the means have the covariances I/6 each, the
  // squared distance is 9·3. Two samples of four are Hotelling's of eight less two degrees of freedom, which in two
  // dimensions exceeds t² with probability (1 + t²/6)^(-5/2).
  using Point2 = Eigen::Vector2d;
  std::vector<Point2> points;
  for (const double x : {0.0, 3.0}) {
    for (const Point2& d : {Point2(1, 0), Point2(-1, 0), Point2(0, 1), Point2(0, -1)})
      points.push_back(Point2(x, 0) + d);
  }
  const SplitOptions options{.splits = 3, .blocks = 2};
  const auto v = validateMeanBySplitting(SerialExecutor{}, points, std::vector<double>(8, 1.0), {}, {}, options);
  EXPECT_NEAR(v.squared_distance, 27, 1e-12);
  EXPECT_NEAR(v.p_value, std::pow(1 + 27.0 / 6, -2.5), 1e-12);
  // The index of splits at random: eight measurements have seven degrees of freedom for each dimension, three splits three.
  EXPECT_DOUBLE_EQ(v.random.effective_dof, 2 / (1.0 / 7 + 1.0 / 3));
  EXPECT_DOUBLE_EQ(v.random.standardError(), 2 * std::sqrt(2 / v.random.effective_dof));
  // One split of two blocks is one difference, whatever they weigh: one degree of freedom.
  EXPECT_DOUBLE_EQ(detail::dealtDegreesOfFreedom({1, 1}, {{1, 0}}), 1);
  EXPECT_DOUBLE_EQ(detail::dealtDegreesOfFreedom({3, 1}, {{1, 0}}), 1);
  EXPECT_DOUBLE_EQ(detail::dealtDegreesOfFreedom({3, 1, 2}, {{1, 0, 0}, {1, 0, 0}}), 1);
}

TEST(SplitValidation, FindsNothingInIndependentErrors) {
  const std::vector<Point> points = measurements(400, 10, 0, 5);
  const auto v = validateMeanBySplitting(SerialExecutor{}, points, std::vector<double>(400, 1.0));
  EXPECT_EQ(v.random.failures + v.by_blocks.failures, 0u);
  // Each fails once in ten thousand seeds; this one is fixed.
  EXPECT_GT(v.random.pValue(), 1e-4);
  EXPECT_GT(v.by_blocks.pValue(), 1e-4);
}

TEST(SplitValidation, FindsErrorsThatBlocksOfTimeShare) {
  // With half of the variance shared by 40 measurements, the variance of a mean is 20.5 times what residuals say.
  const std::vector<Point> points = measurements(400, 10, 0.5, 6);
  const auto v = validateMeanBySplitting(SerialExecutor{}, points, std::vector<double>(400, 1.0));
  EXPECT_GT(v.random.pValue(), 1e-4) << "splits at random do not see it";
  EXPECT_LT(v.by_blocks.pValue(), 1e-6);
  EXPECT_GT(v.by_blocks.factor(), 5);
  EXPECT_LT(v.by_blocks.factorLow(), v.by_blocks.factor());
  EXPECT_GT(v.by_blocks.factorHigh(), v.by_blocks.factor());
}

TEST(SplitValidation, OfOneManifoldByThreeEstimators) {
  // Equal covariances: the mean with known noise and the Mahalanobis mean of rotations agree up to the curvature, and
  // the barycentre is the mean. A tenth of a radian squared is the order that they differ by.
  std::vector<Gaussian<SO3d>> gaussians;
  std::vector<SO3d> rotations;
  const SquareOf<SO3d> noise = 1e-4 * SquareOf<SO3d>::Identity();
  CounterRng rng(7, 0);
  for (int i = 0; i < 40; ++i) {
    rotations.push_back(sample(Gaussian<SO3d>{SO3d::exp({0.3, 0.2, 0.1}), noise}, rng));
    gaussians.push_back({rotations.back(), noise});
  }
  const std::vector<double> weights(40, 1.0);
  const SplitOptions options{.splits = 20};
  const auto known = validateMeanBySplitting(SerialExecutor{}, rotations, weights,
                                             std::vector<SquareOf<SO3d>>(40, noise), {}, options);
  const auto maha = validateMahaBySplitting(SerialExecutor{}, gaussians, CovarianceAt::measured, {}, {}, options);
  EXPECT_NEAR(known.squared_distance, maha.squared_distance, 1e-2 * known.squared_distance);
  EXPECT_NEAR(known.random.index, maha.random.index, 1e-2 * known.random.index);
  const auto mean = validateMeanBySplitting(SerialExecutor{}, rotations, weights, {}, {}, options);
  const auto group = validateGroupMeanBySplitting(SerialExecutor{}, rotations, weights, {}, options);
  EXPECT_LT(distance(mean.merged.result.estimate.mean, group.merged.result.estimate.mean), 1e-6);
  EXPECT_NEAR(mean.by_blocks.index, group.by_blocks.index, 1e-2 * mean.by_blocks.index);
}

TEST(SplitValidation, FloatAgreesWithDouble) {
  const std::vector<Point> points = measurements(60, 10, 0, 8);
  std::vector<Eigen::Vector3f> single;
  for (const Point& p : points) single.push_back(p.cast<float>());
  const std::vector<double> weights(60, 1.0);
  const SplitOptions options{.splits = 20};
  const auto d = validateMeanBySplitting(SerialExecutor{}, points, weights, {}, {}, options);
  const auto f = validateMeanBySplitting(SerialExecutor{}, single, weights, {}, {}, options);
  EXPECT_NEAR(d.random.index, f.random.index, 1e-4 * d.random.index);
  EXPECT_NEAR(d.squared_distance, f.squared_distance, 1e-4 * d.squared_distance);
}

TEST(SplitValidation, PoolingAveragesTheIndices) {
  const SplitSeries a{{1, 3}, 2, 3, 30, 1}, b{{4, 4}, 4, 3, 30, 0};
  const SplitSeries pool = pooled({a, b});
  EXPECT_DOUBLE_EQ(pool.index, 3);
  EXPECT_DOUBLE_EQ(pool.effective_dof, 60);
  EXPECT_EQ(pool.distances.size(), 4u);
  EXPECT_EQ(pool.failures, 1u);
  EXPECT_DOUBLE_EQ(pool.factor(), 1);
}

TEST(SplitValidation, FewestMeasurements) {
  EXPECT_EQ(fewestMeasurements(6, false, {}), 14u);
  EXPECT_EQ(fewestMeasurements(3, false, {}), 10u) << "one for each block";
  EXPECT_EQ(fewestMeasurements(3, true, {.blocks = 2}), 2u);
}

}  // namespace
