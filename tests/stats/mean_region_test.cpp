#include <lie/frame3.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se3.hpp>
#include <lie/so2.hpp>
#include <lie/so3.hpp>
#include <stats/certified_group_mean.hpp>
#include <stats/certified_mean.hpp>
#include <stats/gaussian.hpp>
#include <stats/mean_region.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace {

using namespace liestat;

enum class Law { normal, exponential };

template <class M>
std::vector<M> drawn(Law law, std::size_t n, std::uint64_t trial) {
  CounterRng rng(61, trial);
  std::vector<M> samples;
  for (std::size_t i = 0; i < n; ++i) {
    TangentOf<M> e;
    for (int k = 0; k < ManifoldTraits<M>::DoF; ++k) {
      e[k] = 0.05 * (law == Law::normal ? rng.normal() : -std::log(rng.uniform()) - 1);
    }
    samples.push_back(exp(ManifoldTraits<M>::origin(), e));
  }
  return samples;
}

template <class M>
CertifiedMeanOptions<M> bootstrapOptions() {
  CertifiedMeanOptions<M> options;
  options.region = MeanRegion::bootstrap;
  return options;
}

// Hotelling's 0.95 quantiles of 20 measurements of one and of two dimensions: F(1, 19) = 4.381, 2 · 19/18 F(2, 18),
// F = 3.555.
constexpr double quantile_of_circle = 4.381, quantile_of_direction = 2 * 19 / 18.0 * 3.555;

TEST(MeanRegion, ofSkewedNoiseHoldsTheTruthWhereThatOfTheLawDoesNot) {
  constexpr std::size_t trials = 600;
  const auto options = bootstrapOptions<S2d>();
  std::size_t in_law = 0, in_bootstrap = 0;
  for (std::size_t trial = 0; trial < trials; ++trial) {
    const auto samples = drawn<S2d>(Law::exponential, 20, trial);
    const auto plain = certifiedMean(samples), wide = certifiedMean(samples, options);
    ASSERT_TRUE(plain.estimate && wide.estimate);
    in_law += mahalanobisSquared(*plain.estimate, S2d()) <= quantile_of_direction;
    in_bootstrap += mahalanobisSquared(*wide.estimate, S2d()) <= quantile_of_direction;
  }
  // Four standard errors of a true 0.93 are 0.042; the law has 0.90.
  EXPECT_GT(static_cast<double>(in_bootstrap), (0.93 - 0.042) * trials);
  EXPECT_GT(in_bootstrap, in_law + trials / 50);
}

TEST(MeanRegion, ofNormalNoiseIsHardlyWidened) {
  constexpr std::size_t trials = 400;
  const auto options = bootstrapOptions<SO2d>();
  double sum = 0;
  std::size_t inside = 0;
  for (std::size_t trial = 0; trial < trials; ++trial) {
    const auto result = certifiedMean(drawn<SO2d>(Law::normal, 20, trial), options);
    ASSERT_TRUE(result.estimate);
    EXPECT_GE(result.skew_factor, 1);
    sum += result.skew_factor;
    inside += mahalanobisSquared(*result.estimate, SO2d()) <= quantile_of_circle;
  }
  // 1.018 of 2000 trials, whose standard deviation is 0.05.
  EXPECT_LT(sum / trials, 1.03);
  EXPECT_GT(static_cast<double>(inside), (0.95 - 0.044) * trials) << "four standard errors";
}

TEST(MeanRegion, saysWhatItReturns) {
  const auto samples = drawn<SO3d>(Law::exponential, 20, 3);
  auto options = bootstrapOptions<SO3d>();
  const auto plain = certifiedMean(samples), wide = certifiedMean(samples, options);
  ASSERT_TRUE(plain.estimate && wide.estimate);
  EXPECT_EQ(plain.region, MeanRegion::law);
  EXPECT_EQ(plain.skew_factor, 1);
  EXPECT_EQ(wide.region, MeanRegion::bootstrap);
  EXPECT_GT(wide.skew_factor, 1);
  const double f = wide.skew_factor;
  EXPECT_LT((wide.estimate->covariance - f * f * plain.estimate->covariance).norm(),
            1e-14 * wide.estimate->covariance.norm());
  EXPECT_EQ(certifiedMean(samples, options).estimate->covariance, wide.estimate->covariance) << "bit by bit";
  options.bootstrap.seed = 2;
  const double other = certifiedMean(samples, options).skew_factor;
  EXPECT_NE(other, f);
  EXPECT_NEAR(other, f, 0.15 * f);
}

TEST(MeanRegion, doesNotDependOnUnits) {
  std::vector<Frame3d> metres, micrometres;
  for (const Frame3d& x : drawn<Frame3d>(Law::exponential, 40, 5)) {
    metres.push_back(x);
    micrometres.emplace_back(x.so3(), Eigen::Vector3d(1e6 * x.translation()));
  }
  const auto options = bootstrapOptions<Frame3d>();
  const double f = certifiedMean(metres, options).skew_factor;
  EXPECT_GT(f, 1);
  EXPECT_NEAR(certifiedMean(micrometres, options).skew_factor, f, 1e-6);
}

TEST(MeanRegion, countsMeasurements) {
  const auto some = drawn<Eigen::Vector3d>(Law::exponential, 12, 7);
  std::vector<Eigen::Vector3d> repeated;
  std::vector<double> counts;
  for (std::size_t i = 0; i < some.size(); ++i) {
    counts.push_back(static_cast<double>(1 + i % 4));
    repeated.insert(repeated.end(), 1 + i % 4, some[i]);
  }
  auto options = bootstrapOptions<Eigen::Vector3d>();
  options.noise = ResidualNoise::frequency;
  const auto counted = certifiedMean(some, counts, options), all = certifiedMean(repeated, options);
  EXPECT_NEAR(counted.skew_factor, all.skew_factor, 1e-9);
  ASSERT_TRUE(counted.estimate && all.estimate);
  EXPECT_LT((counted.estimate->covariance - all.estimate->covariance).norm(), 1e-9 * all.estimate->covariance.norm());
}

TEST(MeanRegion, ofBarycentres) {
  CertifiedGroupMeanOptions<SE3d> options;
  options.region = MeanRegion::bootstrap;
  const auto samples = drawn<SE3d>(Law::exponential, 30, 9);
  const auto plain = certifiedGroupMean(samples), wide = certifiedGroupMean(samples, options);
  ASSERT_TRUE(plain.estimate && wide.estimate);
  EXPECT_GT(wide.skew_factor, 1);
  EXPECT_NEAR(wide.estimate->covariance.trace(),
              wide.skew_factor * wide.skew_factor * plain.estimate->covariance.trace(),
              1e-12 * wide.estimate->covariance.trace());
}

TEST(MeanRegion, isWithheldOfTooFewMeasurements) {
  // Half of the draws of ten poses have less than seven different ones.
  const auto poses = drawn<Frame3d>(Law::normal, 10, 11);
  ASSERT_EQ(certifiedMean(poses).status, Status::ok);
  const auto few = certifiedMean(poses, bootstrapOptions<Frame3d>());
  EXPECT_EQ(few.status, Status::too_few);
  EXPECT_STREQ(few.reason, detail::unbounded_region_reason);
  EXPECT_FALSE(few.estimate);
}

TEST(MeanRegion, withoutScatterOrWithKnownNoiseIsThatOfTheLaw) {
  const std::vector<SO3d> equal(20, SO3d::exp(Eigen::Vector3d(0.1, 0.2, 0.3)));
  const auto same = certifiedMean(equal, bootstrapOptions<SO3d>());
  ASSERT_TRUE(same.estimate);
  EXPECT_EQ(same.skew_factor, 1);
  auto options = bootstrapOptions<SO3d>();
  options.known_noise = {SquareOf<SO3d>(0.0025 * SquareOf<SO3d>::Identity())};
  const auto known = certifiedMean(drawn<SO3d>(Law::normal, 20, 13), options);
  ASSERT_TRUE(known.estimate);
  EXPECT_EQ(known.region, MeanRegion::law);
}

TEST(MeanRegion, manyMeasurementsAreDrawnInGroups) {
  // Groups of three with equal members have the skewness of their number.
  const auto some = drawn<S2d>(Law::exponential, 8000, 15);
  std::vector<S2d> thrice;
  for (const S2d& x : some) thrice.insert(thrice.end(), 3, x);
  const auto options = bootstrapOptions<S2d>();
  EXPECT_NEAR(certifiedMean(thrice, options).skew_factor, certifiedMean(some, options).skew_factor, 1e-9);
}

}  // namespace
