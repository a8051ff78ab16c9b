// The certificates from the sums of a mean's last pass (stats/detail/sum_certificates.hpp) against those that look at the
// data: the same verdicts on random samples of every spread, and each bound below what it bounds. By hand, what certificates
// stand on: averaging regions, near ties.

#include <lie/lie.hpp>
#include <stats/certified_mean.hpp>
#include <stats/detail/settled_maha.hpp>
#include <stats/maha.hpp>
#include <stats/random.hpp>
#include <stats/sampling.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace {

using namespace liestat;

constexpr double pi = static_cast<double>(EIGEN_PI);

/// Standard deviations of the angles, rad; the last stands for the uniform law.
constexpr double spreads[] = {1e-6, 1e-3, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.0, 1.4, 10};

template <class M>
std::vector<M> cloud(CounterRng& rng, std::size_t n, double spread) {
  const M centre = sampleInCube<M>(rng);
  std::vector<M> samples;
  for (std::size_t i = 0; i < n; ++i) {
    const TangentOf<M> v = (spread * rng.template normalVector<ManifoldTraits<M>::DoF>()).template cast<ScalarOf<M>>();
    samples.push_back(spread > 2 ? sampleInCube<M>(rng) : exp(centre, v));
  }
  return samples;
}

/// All ones, spread about one, or a few that are far larger.
std::vector<double> weightsOf(CounterRng& rng, std::size_t n, int kind) {
  std::vector<double> weights(n, 1);
  for (double& p : weights) {
    if (kind == 1) p = rng.uniform(0.2, 2);
    if (kind == 2) p = rng.uniform() < 0.2 ? 20 : 0.5;
  }
  return weights;
}

/// A mean that has forgotten what its last pass saw of angles and gaps.
template <class M>
MeanResult<M> blind(MeanResult<M> mean) {
  using S = ScalarOf<M>;
  mean.largest_distance = mean.largest_angle = std::numeric_limits<S>::infinity();
  mean.smallest_gap = -std::numeric_limits<S>::infinity();
  mean.angle_fourth_moment = std::numeric_limits<double>::infinity();
  return mean;
}

template <class M>
class SumCertificates : public testing::Test {};

using Manifolds =
    testing::Types<SO3d, S2d, Frame3d, SemiOrientedFrame3d, NonOrientedFrame3d, SO2d, Frame2d, Eigen::Vector3d>;
TYPED_TEST_SUITE(SumCertificates, Manifolds);

TYPED_TEST(SumCertificates, agreeWithThoseThatLookAtTheData) {
  using M = TypeParam;
  constexpr bool compact = detail::compactFactor<M>() != CompactFactor::none;
  int by_sums = 0, in_all = 0;
  std::uint64_t trial = 0;
  for (const double spread : spreads) {
    for (const std::size_t n : {1, 2, 3, 5, 10, 20, 50, 100, 300, 1000}) {
      for (int kind = 0; kind < 3; ++kind) {
        CounterRng rng(31, trial++);
        const std::vector<M> samples = cloud<M>(rng, n, spread);
        const std::vector<double> weights = weightsOf(rng, n, kind);
        SCOPED_TRACE("spread " + std::to_string(spread) + ", n " + std::to_string(n) + ", weights " +
                     std::to_string(kind));
        CertifiedMeanOptions<M> options;
        options.uniqueness.budget = 100'000;
        const MeanResult<M> mean = kind == 0 ? liestat::mean(samples) : liestat::mean(samples, weights);
        const CertifiedMean<M> fast =
            kind == 0 ? certifiedMean(samples, options) : certifiedMean(samples, weights, options);
        const CertifiedMean<M> full =
            detail::findCertifiedMean<M>(detail::erased(SerialExecutor{}), detail::asSamples(samples),
                                         detail::asWeights(weights), options, blind(mean));
        ++in_all;
        CertifiedMean<M> by_sums_alone;
        by_sums_alone.mean = mean;
        by_sums += detail::certifyBySums(detail::weightSums(weights, n), options, by_sums_alone);

        EXPECT_EQ(fast.status, full.status);
        EXPECT_STREQ(fast.reason, full.reason);
        EXPECT_EQ(fast.near_ties.size(), full.near_ties.size());
        // The full search may have spent its budget.
        if (full.uniqueness.unique != Uniqueness::not_certified) {
          EXPECT_EQ(fast.uniqueness.unique, full.uniqueness.unique);
        }
        EXPECT_EQ(fast.uniqueness.improved, full.uniqueness.improved);
        EXPECT_EQ(fast.hessian_change, full.hessian_change);
        EXPECT_EQ(fast.cut_locus.mass, full.cut_locus.mass);
        EXPECT_EQ(fast.cut_locus.window, full.cut_locus.window);
        EXPECT_EQ(fast.cut_locus.hessian_change, full.cut_locus.hessian_change);
        EXPECT_EQ(fast.concentration.concentrated, full.concentration.concentrated);
        if (compact && full.status == Status::ok) {
          EXPECT_NEAR(fast.concentration.mean_square, full.concentration.mean_square, 1e-12);
          EXPECT_LE(fast.uniqueness.r_star, full.uniqueness.r_star + 1e-6);
          if (detail::compactFactor<M>() != CompactFactor::sphere) {
            EXPECT_NEAR(fast.uniqueness.r_star, full.uniqueness.r_star, 1e-6);
          }
        }
        ASSERT_EQ(fast.estimate.has_value(), full.estimate.has_value());
        if (fast.region_factor != full.region_factor) {
          // The sums say that no valley leads out of the region. Scores of a few data, which are far from normal, may
          // not reject a feature just outside of it; those of more do.
          EXPECT_LT(n, detail::min_data_of_valley);
          EXPECT_LE(full.region_factor, detail::largest_region_factor);
          EXPECT_EQ(fast.region_factor, 1);
        } else if (fast.estimate) {
          EXPECT_LE((fast.estimate->covariance - full.estimate->covariance).norm(),
                    1e-12 * full.estimate->covariance.norm());
          EXPECT_LE(static_cast<double>(log(fast.estimate->mean, full.estimate->mean).norm()), 1e-12);
        }
      }
    }
  }
  // Tight clouds with more features than dimensions, at least.
  EXPECT_GT(by_sums, in_all / 6);
  if (compact) {
    EXPECT_LT(by_sums, in_all);
  }
}

/// The excess of the criterion at ρ, divided by ρ and the sum of the weights, is no less than the bound, and neither is
/// Student's statistic of the differences: the proofs follow from these two.
TYPED_TEST(SumCertificates, boundTheCriterionAndStudentsStatistic) {
  using M = TypeParam;
  if constexpr (detail::compactFactor<M>() != CompactFactor::none) {
    constexpr int K = detail::compact_dimension<M>, begin = ManifoldTraits<M>::compact_begin;
    std::uint64_t trial = 0;
    for (const double spread : {0.05, 0.2, 0.35, 0.5, 0.8}) {
      for (const std::size_t n : {5, 40, 400}) {
        CounterRng rng(32, trial++);
        const std::vector<M> samples = cloud<M>(rng, n, spread);
        const MeanResult<M> mean = liestat::mean(samples);
        if (!converged(mean.status)) continue;
        const detail::AngleSums angles = detail::angleSums(mean);
        const detail::ExcessBound bound(angles);
        const auto squaredAngles = [&](const M& y) {
          std::vector<double> squares;
          for (const M& x : samples) squares.push_back(log(y, x).template segment<K>(begin).squaredNorm());
          return squares;
        };
        const std::vector<double> at_mean = squaredAngles(mean.mean);
        for (int i = 0; i < 60; ++i) {
          TangentOf<M> v = TangentOf<M>::Zero();
          v.template segment<K>(begin) = rng.uniform(0, pi) * rng.template normalVector<K>().normalized();
          const M y = exp(mean.mean, v);
          const double rho = log(mean.mean, y).template segment<K>(begin).norm();
          const std::vector<double> there = squaredAngles(y);
          double sum = 0, squares = 0;
          for (std::size_t k = 0; k < n; ++k) {
            const double e = 0.5 * (there[k] - at_mean[k]);
            sum += e, squares += e * e;
          }
          const double excess = sum / (double(n) * rho);
          EXPECT_GE(excess + 1e-9, bound.far(rho)) << "rho " << rho << ", spread " << spread << ", n " << n;
          for (const double wider : {1.0, 1.05, 1.3}) {
            EXPECT_GE(excess + 1e-9, bound.near(rho, wider * rho)) << "rho " << rho << ", spread " << spread;
          }
          const double variance = squares / double(n) - sum * sum / double(n * n);
          const double z2 = sum * sum / double(n * n) / std::max(variance, 1e-15);  // over n - 1
          if (bound.far(rho) > 0) {
            EXPECT_GE(z2 * (1 + 1e-6), 0.25 * rho * rho / angles.mean_square - 1) << "rho " << rho;
          }
        }
      }
    }
  }
}

/// r* on the sphere from its bound: below the exact one, and near it for clouds.
TEST(SumCertificatesOnTheSphere, boundTheRadiusOfConvexity) {
  for (std::uint64_t trial = 0; trial < 200; ++trial) {
    CounterRng rng(33, trial);
    const double spread = rng.uniform(0.001, 0.7);
    const std::vector<S2d> samples = cloud<S2d>(rng, 20, spread);
    const MeanResult<S2d> mean = liestat::mean(samples);
    if (!converged(mean.status) || mean.largest_angle > 0.99 * pi) continue;
    const double exact = localRadius(samples, mean.mean);
    const double lower = detail::angleSums(mean).convex;
    EXPECT_LE(lower, exact + 1e-9) << "spread " << spread;
    if (spread < 0.2) {
      EXPECT_GE(lower, exact - spread) << "spread " << spread;
    }
  }
}

/// The distance to the cut locus that the last pass has seen is that which looks at the data, but for the last step.
TYPED_TEST(SumCertificates, knowTheDistanceToTheCutLocus) {
  using M = TypeParam;
  for (const double spread : {0.05, 0.2, 0.4}) {
    CounterRng rng(34, static_cast<std::uint64_t>(100 * spread));
    const std::vector<M> samples = cloud<M>(rng, 30, spread);
    const MeanResult<M> mean = liestat::mean(samples);
    ASSERT_TRUE(converged(mean.status));
    if constexpr (detail::compactFactor<M>() != CompactFactor::none) {
      EXPECT_NEAR(detail::leastDistanceToCutLocus(mean), detail::distanceToCutLocus(samples, mean.mean), 1e-6)
          << spread;
    }
  }
}

/// The region of a settled covariance is so many standard deviations wide, its covariance their square.
TEST(SettledCovariance, averagesOverAWidthInStandardDeviations) {
  for (const std::size_t n : {5, 10, 30}) {
    CounterRng rng(35, n);
    const std::vector<SO3d> samples = cloud<SO3d>(rng, n, 0.8);
    const auto features = detail::asSamples(samples);
    const auto weights = detail::ones(n);
    const MeanResult<SO3d> mean = liestat::mean(samples);
    ASSERT_TRUE(converged(mean.status));
    const double width = std::min(2.0, 0.1 * static_cast<double>(n));
    const Eigen::Matrix3d region = 0.36 * Eigen::Matrix3d::Identity(), covariance = region / (width * width);
    const auto settled =
        detail::settleCovariance(features, weights, mean, 1.0, [&](const auto&) { return covariance; });
    const auto averaged = detail::findAveragedHessian(features, weights, mean, region);
    ASSERT_TRUE(averaged.averaged && settled.settled) << n;
    EXPECT_LE((settled.hessian - averaged.hessian).norm(), 1e-12 * averaged.hessian.norm()) << n;
    EXPECT_NEAR(settled.change, averaged.change, 1e-12) << n;
  }
}

/// On the circle the Hessian is Σ 1/s², and so is Gauss' and Newton's. Averaged it is less by the change, and the covariance
/// greater by the square of that.
TEST(SettledMaha, hasTheCovarianceOfTheAveragedHessian) {
  const double variance = 1;
  std::vector<Gaussian<SO2d>> samples;
  for (int i = 0; i < 42; ++i) {
    const double angle = i < 2 ? 2.8 : 0.3;  // one pair near the cut locus of the mean
    samples.push_back({SO2d(i % 2 == 0 ? angle : -angle), variance * SquareOf<SO2d>::Ones()});
  }
  const auto result = maha(samples, CovarianceAt::measured);
  ASSERT_EQ(result.status, Status::ok);
  const auto settled = detail::settleMaha<SO2d>(SerialExecutor{}, samples, CovarianceAt::measured, false, result, 1.0);
  ASSERT_TRUE(settled.settled);
  ASSERT_GT(settled.change, 0.01);
  EXPECT_NEAR(settled.covariance(0, 0), variance / 42 / std::pow(1 - settled.change, 2), 1e-12);
}

/// Angles ±1.5 and ±1.6 have their mean at 0, the rival π, and local minima at ±π/2, one datum taken the other way.
TEST(NearTies, haveStudentsStatisticOfTheDifferences) {
  const std::vector<SO2d> samples{SO2d(1.5), SO2d(-1.5), SO2d(1.6), SO2d(-1.6)};
  const MeanResult<SO2d> mean = liestat::mean(samples);
  ASSERT_NEAR(distance(mean.mean, SO2d(0.0)), 0, 1e-12);
  SquareOf<SO2d> covariance;
  covariance << 0.01;  // no minimum lies in its region
  const auto ties = nearTies(samples, mean, covariance);
  ASSERT_EQ(ties.size(), 3U);
  // ½ ((π - a)² - a²) for each angle.
  const double a = 0.5 * pi * (pi - 3), b = 0.5 * pi * (pi - 3.2), average = 0.5 * (a + b);
  const double sd = std::sqrt(2 * (std::pow(a - average, 2) + std::pow(b - average, 2)) / 3);
  EXPECT_NEAR(distance(ties[0].feature, SO2d(pi)), 0, 1e-12);
  EXPECT_NEAR(ties[0].z, 4 * average / (std::sqrt(4.0) * sd), 1e-12);
}

TEST(SumCertificatesOfWeights, addUp) {
  std::vector<double> weights(1003, 1);
  EXPECT_TRUE(detail::weightSums(weights, weights.size()).ones);
  EXPECT_EQ(detail::weightSums(weights, weights.size()).squares, 1003);
  weights[1002] = 3;
  const detail::WeightSums sums = detail::weightSums(weights, weights.size());
  EXPECT_FALSE(sums.ones);
  EXPECT_EQ(sums.n, 1003);
  EXPECT_EQ(sums.sum, 1005);
  EXPECT_EQ(sums.squares, 1011);
}

}  // namespace
