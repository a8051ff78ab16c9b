// Statistics on the groups with a scale: sampling, means in both senses, MAHA.

#include <lie/rxso3.hpp>
#include <lie/sim3.hpp>
#include <stats/group_mean.hpp>
#include <stats/maha.hpp>
#include <stats/mean.hpp>
#include <stats/sampling.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace {

using namespace liestat;

TEST(ScaledGroups, UniformSamplesHaveEveryScale) {
  const int n = 4000;
  CounterRng rng(3, 0);
  double sum = 0, squares = 0, largest = 0;
  for (int i = 0; i < n; ++i) {
    const Sim3d x = sampleInCube<Sim3d>(rng, 10);
    const double octaves = std::log2(x.scale());
    sum += octaves, squares += octaves * octaves;
    largest = std::max(largest, x.translation().cwiseAbs().maxCoeff());
  }
  // Uniform in [-1, 1]: variance 1/3, that of the square 4/45; six standard errors.
  EXPECT_NEAR(sum / n, 0, 6 * std::sqrt(1. / 3 / n));
  EXPECT_NEAR(squares / n, 1. / 3, 6 * std::sqrt(4. / 45 / n));
  EXPECT_LE(largest, 10);
  EXPECT_GE(largest, 9.9);
}

// The metric is that of the product: rotations and logarithms of scales are averaged apart.
TEST(ScaledGroups, TheMeanOfScaledRotationsIsThatOfTheFactors) {
  CounterRng rng(4, 0);
  const Gaussian<RxSO3d> cloud{RxSO3d(3., SO3d::rotX(1)), Eigen::Vector4d(0.2, 0.1, 0.3, 0.5).asDiagonal()};
  std::vector<RxSO3d> samples;
  std::vector<SO3d> rotations;
  double log_scale = 0;
  const int n = 50;
  for (int i = 0; i < n; ++i) {
    samples.push_back(sample(cloud, rng));
    rotations.push_back(samples.back().so3());
    log_scale += std::log(samples.back().scale()) / n;
  }
  const auto all = mean(samples);
  ASSERT_TRUE(converged(all.status));
  EXPECT_NEAR(std::log(all.mean.scale()), log_scale, 1e-12);
  EXPECT_LE((all.mean.so3().inverse() * mean(rotations).mean).log().norm(), 1e-11);
}

TEST(ScaledGroups, TheGroupMeanOfSimilaritiesMovesWithThem) {
  CounterRng rng(5, 0);
  const Gaussian<Sim3d> cloud{Sim3d(RxSO3d(0.5, SO3d::rotZ(2)), Eigen::Vector3d(1, 2, 3)),
                              Eigen::Matrix<double, 7, 7>(0.02 * Eigen::Matrix<double, 7, 7>::Identity())};
  const Sim3d f = sampleInCube<Sim3d>(rng), g = sampleInCube<Sim3d>(rng);
  std::vector<Sim3d> samples, moved;
  for (int i = 0; i < 20; ++i) {
    samples.push_back(sample(cloud, rng));
    moved.push_back(f * samples.back() * g);
  }
  const auto mean = groupMean(samples), moved_mean = groupMean(moved);
  ASSERT_EQ(mean.status, Status::ok);
  ASSERT_EQ(moved_mean.status, Status::ok);
  EXPECT_LE(((f * mean.mean * g).inverse() * moved_mean.mean).log().norm(), 1e-10) << "from either side";
}

TEST(ScaledGroups, TheCovarianceOfMahaIsRight) {
  using Matrix7 = Eigen::Matrix<double, 7, 7>;
  const int trials = 300, n = 12;
  double index = 0;
  for (std::uint64_t trial = 0; trial < trials; ++trial) {
    CounterRng rng(6, trial);
    const Sim3d truth = sampleInCube<Sim3d>(rng);
    std::vector<Gaussian<Sim3d>> measurements;
    for (int i = 0; i < n; ++i) {
      Eigen::Matrix<double, 7, 1> sd;
      for (int k = 0; k < 7; ++k) sd[k] = 0.05 * rng.uniform();
      const Matrix7 noise = sd.cwiseAbs2().asDiagonal();
      measurements.push_back({sample(Gaussian<Sim3d>{truth, noise}, rng), noise});
    }
    const auto result = maha(measurements);
    ASSERT_EQ(result.status, Status::ok);
    index += mahalanobisSquared(result.estimate(), truth) / trials;
  }
  // The mean of 300 χ²_7: standard error √(14/300). Five of them are exceeded once in two million seeds.
  EXPECT_NEAR(index, 7, 5 * std::sqrt(14. / trials));
}

}  // namespace
