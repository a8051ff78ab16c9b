// Weights are relative: any common factor and any size of them give the same estimates, zero leaves a feature out, and
// what is no weight gives a status.

#include <stats/certified_group_mean.hpp>
#include <stats/certified_mean.hpp>
#include <stats/covariance.hpp>
#include <stats/dispersion.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/group_mean.hpp>
#include <stats/mean.hpp>
#include <stats/random.hpp>

#include <lie/lie.hpp>

#include <support/product_samples.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using liestat_test::scattered;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t n = 12;

std::vector<double> ordinaryWeights(double factor = 1) {
  std::vector<double> weights;
  for (std::size_t i = 0; i < n; ++i) weights.push_back(factor * (0.5 + 0.1 * static_cast<double>(i)));
  return weights;
}

template <class T>
std::vector<T> without(std::vector<T> list, std::size_t i) {
  list.erase(list.begin() + static_cast<std::ptrdiff_t>(i));
  return list;
}

template <class Matrix>
void expectNear(const Matrix& found, const Matrix& expected, double tolerance) {
  EXPECT_LE((found - expected).norm(), tolerance * (1 + expected.norm()));
}

template <class M>
class WeightsTest : public testing::Test {};
using Manifolds = testing::Types<SO3d, SO3f, S2d, Frame3d, SemiOrientedFrame3d>;
TYPED_TEST_SUITE(WeightsTest, Manifolds);

TYPED_TEST(WeightsTest, OnlyRatiosMatter) {
  using M = TypeParam;
  const double tolerance = 64 * static_cast<double>(std::numeric_limits<ScalarOf<M>>::epsilon());
  const auto samples = scattered<M>(static_cast<int>(n), 0.1);
  const auto expected = certifiedMean(samples, ordinaryWeights());
  ASSERT_EQ(expected.status, Status::ok);
  // From the smallest normal numbers to the largest.
  for (const double factor : {1e-300, 1e-165, 1e-9, 1e9, 1e155, 1e300}) {
    const auto weights = ordinaryWeights(factor);
    const auto found = certifiedMean(samples, weights);
    ASSERT_EQ(found.status, Status::ok) << factor;
    EXPECT_LE(static_cast<double>(distance(found.mean.mean, expected.mean.mean)), tolerance);
    expectNear(found.estimate->covariance, expected.estimate->covariance, tolerance);
    expectNear(dispersionAbout(samples, weights, found.mean.mean).covariance, expected.mean.dispersion(), 1e-5);
    const std::vector<SquareOf<M>> noise(n, SquareOf<M>::Identity());
    expectNear(covarianceFromNoise(found.mean, weights, noise),
               covarianceFromNoise(expected.mean, ordinaryWeights(), noise), tolerance);
    CertifiedMeanOptions<M> known;
    known.known_noise = std::vector<SquareOf<M>>(n, SquareOf<M>(ScalarOf<M>(0.01) * SquareOf<M>::Identity()));
    const auto with_noise = certifiedMean(samples, weights, known);
    ASSERT_EQ(with_noise.status, Status::ok) << factor;
    expectNear(with_noise.estimate->covariance, certifiedMean(samples, ordinaryWeights(), known).estimate->covariance,
               tolerance);
  }
}

TYPED_TEST(WeightsTest, ZeroLeavesAFeatureOut) {
  using M = TypeParam;
  const auto samples = scattered<M>(static_cast<int>(n), 0.1);
  for (const std::size_t left_out : {std::size_t{0}, std::size_t{5}, n - 1}) {
    auto weights = ordinaryWeights();
    const auto others = certifiedMean(without(samples, left_out), without(weights, left_out));
    // A weight whose square is no number beside the others' says as much.
    for (const double nothing : {0., 1e-200}) {
      weights[left_out] = nothing;
      const auto found = certifiedMean(samples, weights);
      EXPECT_EQ(found.mean.n, n - 1);
      EXPECT_EQ(found.status, others.status);
      EXPECT_LE(distance(found.mean.mean, others.mean.mean), 8 * std::numeric_limits<ScalarOf<M>>::epsilon());
      expectNear(found.estimate->covariance, others.estimate->covariance, 0);
      EXPECT_EQ(mean(samples, weights).n, n - 1);
      const auto farthest = dispersionAbout(samples, weights, others.mean.mean).farthest;
      const auto expected = dispersionAbout(without(samples, left_out), without(weights, left_out), others.mean.mean);
      ASSERT_EQ(farthest.size(), expected.farthest.size());
      for (std::size_t i = 0; i < farthest.size(); ++i) {
        const std::size_t index = expected.farthest[i].index;
        EXPECT_EQ(farthest[i].index, index + (index >= left_out ? 1 : 0));
      }
    }
  }
  // Known noise of each feature goes with it.
  auto weights = ordinaryWeights();
  weights[3] = 0;
  CertifiedMeanOptions<M> all, others;
  for (std::size_t i = 0; i < n; ++i) {
    all.known_noise.push_back(
        SquareOf<M>(ScalarOf<M>(0.01 + 0.001 * static_cast<double>(i)) * SquareOf<M>::Identity()));
  }
  others.known_noise = without(all.known_noise, 3);
  const auto found = certifiedMean(samples, weights, all);
  const auto expected = certifiedMean(without(samples, 3), without(weights, 3), others);
  ASSERT_EQ(found.status, Status::ok);
  expectNear(found.estimate->covariance, expected.estimate->covariance, 0);
}

TYPED_TEST(WeightsTest, WhatIsNoWeightGivesAStatus) {
  using M = TypeParam;
  const auto samples = scattered<M>(static_cast<int>(n), 0.1);
  const auto refused = [&](const std::vector<double>& weights) {
    const auto found = certifiedMean(samples, weights);
    EXPECT_EQ(found.status, Status::not_applicable);
    EXPECT_FALSE(found.estimate);
    EXPECT_NE(std::string(found.reason), "");
    EXPECT_EQ(mean(samples, weights).status, Status::not_applicable);
    EXPECT_FALSE(converged(mean(samples, weights).status));
    EXPECT_EQ(uniqueness(samples, weights, mean(samples)).unique, Uniqueness::not_certified);
  };
  for (const double bad : {-1e-300, -1., nan, infinity, -infinity}) {
    auto weights = ordinaryWeights();
    weights[4] = bad;
    refused(weights);
  }
  refused(std::vector<double>(n, 0.0));
}

TEST(Weights, OfBarycentres) {
  const auto samples = scattered<SE3d>(static_cast<int>(n), 0.1);
  const auto expected = certifiedGroupMean(samples, ordinaryWeights());
  ASSERT_EQ(expected.status, Status::ok);
  for (const double factor : {1e-300, 1e155}) {
    const auto found = certifiedGroupMean(samples, ordinaryWeights(factor));
    ASSERT_EQ(found.status, Status::ok);
    EXPECT_LE(log(found.mean.mean, expected.mean.mean).norm(), 1e-13);
    expectNear(found.estimate->covariance, expected.estimate->covariance, 1e-12);
  }
  auto weights = ordinaryWeights();
  weights[2] = 0;
  const auto found = certifiedGroupMean(samples, weights);
  EXPECT_EQ(found.mean.n, n - 1);
  expectNear(found.estimate->covariance,
             certifiedGroupMean(without(samples, 2), without(weights, 2)).estimate->covariance, 0);
  weights[2] = nan;
  EXPECT_EQ(certifiedGroupMean(samples, weights).status, Status::not_applicable);
  EXPECT_EQ(groupMean(samples, weights).status, Status::not_applicable);
}

// Rotations by 0 and 0.9 about one axis, with weights as 2 to 1: the barycentre is 0.3, the residuals -0.3 and 0.6, their
// second moment (2·0.09 + 0.36)/3, and as many times that over n - 1 is the variance of the barycentre.
TEST(Weights, OfABarycentreByHand) {
  const std::vector<SO3d> rotations{SO3d::rotZ(0), SO3d::rotZ(0.9)};
  for (const double unit : {1.0, 0.01}) {
    const auto found = groupMean(rotations, std::vector<double>{2 * unit, unit});
    ASSERT_EQ(found.status, Status::ok);
    EXPECT_NEAR(found.mean.log().z(), 0.3, 1e-15);
    EXPECT_NEAR(found.dispersion()(2, 2), 0.18, 1e-15);
    EXPECT_NEAR((found.scatter(2, 2) / (found.jacobian(2, 2) * found.jacobian(2, 2))) * found.sum_of_weights, 0.18,
                1e-15);
  }
}

// Half of the weights 1e300, half 1e-300: the second half is not there.
TEST(Weights, OfVeryDifferentSizes) {
  const auto samples = scattered<SO3d>(static_cast<int>(n), 0.1);
  std::vector<double> weights;
  for (std::size_t i = 0; i < n; ++i) weights.push_back(i < n / 2 ? 1e300 : 1e-300);
  const auto found = certifiedMean(samples, weights);
  const auto half = certifiedMean(std::vector<SO3d>(samples.begin(), samples.begin() + n / 2));
  EXPECT_EQ(found.mean.n, n / 2);
  EXPECT_LE(distance(found.mean.mean, half.mean.mean), 1e-15);
  expectNear(found.estimate->covariance, half.estimate->covariance, 1e-14);
}

// In debug builds an assertion.
TEST(Weights, OfAnotherNumber) {
#ifdef NDEBUG
  const auto samples = scattered<SO3d>(static_cast<int>(n), 0.1);
  EXPECT_EQ(mean(samples, std::vector<double>(n - 1, 1.0)).status, Status::not_applicable);
#endif
}

/// Rotations of one law under weights that have nothing to do with it: how often the 95 % region holds the truth.
TEST(Weights, ThatAreImportances) {
  constexpr int trials = 500;
  int ok = 0, inside = 0, precise = 0, inside_as_precisions = 0, flagged = 0;
  for (std::uint64_t t = 0; t < trials; ++t) {
    CounterRng rng(5, t);
    std::vector<SO3d> features;
    std::vector<double> weights;
    for (int i = 0; i < 50; ++i) {
      weights.push_back(std::exp(rng.normal()));
      features.push_back(SO3d::exp(Eigen::Vector3d(0.2 * rng.normalVector<3>())));
    }
    const auto holds = [](const CertifiedMean<SO3d>& found) {
      return detail::hotellingTail(mahalanobisSquared(*found.estimate, SO3d()), 3, found.law_n) > 0.05;
    };
    CertifiedMeanOptions<SO3d> options;
    const auto plain = certifiedMean(features, weights, options);
    if (plain.estimate) ++precise, inside_as_precisions += holds(plain);
    options.noise = ResidualNoise::importance;
    const auto found = certifiedMean(features, weights, options);
    if (found.estimate) ++ok, inside += holds(found);
    EXPECT_TRUE(found.estimate || found.status == Status::too_few);
    flagged += dispersionAbout(features, weights, found.mean.mean).order.weightsAreNoPrecisions();
  }
  EXPECT_GT(ok, 0.95 * trials);
  EXPECT_GE(inside, (0.93 - 4 * std::sqrt(0.93 * 0.07 / ok)) * ok);
  EXPECT_LT(inside_as_precisions, 0.75 * precise);
  EXPECT_GT(flagged, 0.9 * trials);
}

TEST(Weights, ThatArePrecisionsAreNotFlagged) {
  constexpr int trials = 1000;
  int flagged = 0;
  for (std::uint64_t t = 0; t < trials; ++t) {
    CounterRng rng(6, t);
    std::vector<SO3d> features;
    std::vector<double> weights;
    for (int i = 0; i < 50; ++i) {
      weights.push_back(std::exp(rng.normal()));
      features.push_back(SO3d::exp(Eigen::Vector3d(0.1 / std::sqrt(weights.back()) * rng.normalVector<3>())));
    }
    flagged += dispersionAbout(features, weights, mean(features, weights).mean).order.weightsAreNoPrecisions();
  }
  EXPECT_LE(flagged, (0.01 + 4 * std::sqrt(0.01 * 0.99 / trials)) * trials);
}

/// Counts give what the features give that are written out, with Hotelling's law for all of them.
TEST(Weights, ThatAreCounts) {
  const std::vector<SO3d> features = scattered<SO3d>(n, 0.3);
  std::vector<double> counts;
  std::vector<SO3d> written_out;
  for (std::size_t i = 0; i < n; ++i) {
    counts.push_back(static_cast<double>(1 + i % 3));
    written_out.insert(written_out.end(), 1 + i % 3, features[i]);
  }
  CertifiedMeanOptions<SO3d> options;
  options.noise = ResidualNoise::frequency;
  const auto counted = certifiedMean(features, counts, options), all = certifiedMean(written_out);
  ASSERT_TRUE(counted.estimate && all.estimate);
  EXPECT_LT((counted.mean.mean.inverse() * all.mean.mean).log().norm(), 1e-12);
  EXPECT_EQ(counted.law_n, static_cast<double>(written_out.size()));
  const double size = all.estimate->covariance.norm();
  EXPECT_LT(
      (covarianceFromResiduals(counted.mean, ResidualNoise::frequency) - covarianceFromResiduals(all.mean)).norm(),
      1e-10 * size);
  CertifiedGroupMeanOptions<SE3d> of_poses;
  of_poses.noise = ResidualNoise::frequency;
  std::vector<SE3d> poses, all_poses;
  for (const SO3d& R : features) poses.push_back(SE3d(R, R.log()));
  for (const SO3d& R : written_out) all_poses.push_back(SE3d(R, R.log()));
  const auto barycentre = certifiedGroupMean(poses, counts, of_poses), of_all = certifiedGroupMean(all_poses);
  ASSERT_TRUE(barycentre.estimate && of_all.estimate);
  EXPECT_LT((barycentre.estimate->covariance - of_all.estimate->covariance).norm(),
            1e-6 * of_all.estimate->covariance.norm());
}

TEST(Weights, WithTooLittleInEffect) {
  const std::vector<SO3d> features = scattered<SO3d>(n, 0.3);
  std::vector<double> weights(n, 1e-3);
  for (std::size_t i = 0; i < 7; ++i) weights[i] = 1;
  CertifiedMeanOptions<SO3d> options;
  options.noise = ResidualNoise::importance;
  EXPECT_EQ(certifiedMean(features, weights, options).status, Status::too_few);
  EXPECT_EQ(certifiedMean(features, options).status, Status::ok);
}

}  // namespace
