// Tests of whether scattered features have a mean: the level of the test of uniformity on each compact space, its
// constants, and its handling of weights and products. Seeds are fixed.

#include <lie/lie.hpp>
#include <stats/concentration.hpp>
#include <stats/random.hpp>
#include <stats/sampling.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector3d;

constexpr double pi = static_cast<double>(EIGEN_PI);

template <class M>
M uniform(CounterRng& rng) {
  if constexpr (std::is_same_v<M, SO2d>) {
    return SO2d(rng.uniform(-pi, pi));
  } else if constexpr (std::is_same_v<M, S2d>) {
    return S2d(Vector3d(rng.unitVector<3>()));
  } else if constexpr (std::is_same_v<M, SO3d>) {
    return SO3d::fromParams(rng.unitQuaternion().coeffs());
  } else {
    return M(uniform<SO3d>(rng), Vector3d::Zero());
  }
}

template <class M>
std::vector<M> uniformSamples(std::uint64_t seed, std::uint64_t trial, int n) {
  CounterRng rng(seed, trial);
  std::vector<M> samples;
  for (int i = 0; i < n; ++i) samples.push_back(uniform<M>(rng));
  return samples;
}

/// The best mean of several starts: the test is about the minimum.
template <class M>
M lowestMean(const std::vector<M>& samples) {
  MeanResult<M> best = mean(samples);
  for (std::size_t i = 0; i < samples.size() && i < 12; ++i) {
    MeanOptions<M> options;
    options.start = samples[i * samples.size() / std::min<std::size_t>(samples.size(), 12)];
    const MeanResult<M> other = mean(samples, options);
    if (converged(other.status) && other.cost < best.cost) best = other;
  }
  return best.mean;
}

/// V₀ within four standard errors of 40 000 draws; the level at each n, 0.01, within four of the trials (0.6 points of
/// 5000 trials) and the 0.1 points by which the fitted quantile may be off.
template <class M>
void rejectsTheUniformLawOnceInAHundred(const char* what) {
  CounterRng rng(1);
  double sum = 0, squares = 0;
  constexpr int draws = 40000;
  for (int i = 0; i < draws; ++i) {
    const TangentOf<M> z = log(ManifoldTraits<M>::origin(), uniform<M>(rng));
    const double square = z.squaredNorm();
    sum += square, squares += square * square;
  }
  const double expectation = sum / draws;
  const double se = std::sqrt((squares / draws - expectation * expectation) / draws);
  const auto any = concentration(uniformSamples<M>(2, 0, 5), ManifoldTraits<M>::origin());
  EXPECT_NEAR(any.uniform, expectation, 4 * se) << what;

  for (const int n : {2, 5, 12, 40}) {
    const int trials = n > 12 ? 1500 : 5000;
    int concentrated = 0;
    for (int t = 0; t < trials; ++t) {
      const auto samples = uniformSamples<M>(3, static_cast<std::uint64_t>(t), n);
      concentrated += concentration(samples, lowestMean(samples)).concentrated;
    }
    const double rate = static_cast<double>(concentrated) / trials;
    const double error = 4 * std::sqrt(0.01 * 0.99 / trials) + 0.001;
    EXPECT_LE(rate, 0.01 + error) << what << " n = " << n;
    // With two data the quantile is so close to the largest value that its fit is on the safe side.
    if (n > 2) {
      EXPECT_GE(rate, 0.01 - error) << what << " n = " << n;
    }
  }
}

TEST(Concentration, rejectsTheUniformLawOnceInAHundred) {
  rejectsTheUniformLawOnceInAHundred<SO2d>("SO2");
  rejectsTheUniformLawOnceInAHundred<S2d>("S2");
  rejectsTheUniformLawOnceInAHundred<SO3d>("SO3");
  rejectsTheUniformLawOnceInAHundred<SemiOrientedFrame3d>("SemiOrientedFrame3");
  rejectsTheUniformLawOnceInAHundred<NonOrientedFrame3d>("NonOrientedFrame3");
}

TEST(Concentration, tightFeaturesAreConcentratedAndOneIsNot) {
  CounterRng rng(5);
  std::vector<SO3d> tight;
  for (int i = 0; i < 10; ++i) tight.push_back(SO3d::exp(0.1 * rng.normalVector<3>()));
  const Concentration found = concentration(tight, mean(tight).mean);
  EXPECT_TRUE(found.concentrated);
  EXPECT_TRUE(found.isModest());
  double sum = 0;
  for (const SO3d& x : tight) sum += std::pow(distance(mean(tight).mean, x), 2);
  EXPECT_NEAR(found.mean_square, sum / 10, 1e-12);
  EXPECT_FALSE(concentration(std::vector<SO3d>{SO3d()}, SO3d()).concentrated) << "one datum shows nothing";
  EXPECT_TRUE(concentration(std::vector<Vector3d>{Vector3d(1e9, 0, 0)}, Vector3d(0, 0, 0)).concentrated);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(concentration(std::vector<SO2d>{SO2d(nan), SO2d(0.1)}, SO2d(0.0)).concentrated);
}

TEST(Concentration, oneHeavyDatumDoesNotMakeAMean) {
  // About a datum that decides where the mean is the weighted scatter is small, whatever the others do.
  int concentrated = 0;
  constexpr int trials = 2000;
  for (std::uint64_t t = 0; t < trials; ++t) {
    const auto samples = uniformSamples<SO3d>(7, t, 40);
    std::vector<double> weights(40, 1.0);
    weights[0] = 1000;
    const auto found = mean(samples, weights);
    concentrated += concentration(samples, weights, found.mean).concentrated;
  }
  EXPECT_LE(concentrated / double(trials), 0.01 + 4 * std::sqrt(0.01 / trials));
  // And weights do not hide that all of the data are concentrated.
  CounterRng rng(8);
  std::vector<SO3d> tight;
  std::vector<double> weights;
  for (int i = 0; i < 20; ++i) tight.push_back(SO3d::exp(0.3 * rng.normalVector<3>())), weights.push_back(i ? 1 : 1e6);
  EXPECT_TRUE(concentration(tight, weights, mean(tight, weights).mean).concentrated);
}

TEST(Concentration, theMostScatteredFactorCounts) {
  using M = Product<SO3d, S2d>;
  std::vector<M> samples;
  CounterRng rng(9);
  for (int i = 0; i < 15; ++i) samples.push_back({SO3d::exp(0.1 * rng.normalVector<3>()), uniform<S2d>(rng)});
  const M at = mean(samples).mean;
  const Concentration found = concentration(samples, at);
  EXPECT_FALSE(found.concentrated);
  EXPECT_NEAR(found.uniform, 0.5 * (pi * pi - 4), 1e-12) << "that of the sphere";
}

}  // namespace
