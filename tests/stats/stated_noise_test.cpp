// Noise that is stated for measurements is a hypothesis: what they refute enters no covariance, and right noise is not
// refuted. Seeds are fixed; rates are bounded exactly, by the binomial law at 1 in 10000.

#include <lie/lie.hpp>
#include <stats/certified_group_mean.hpp>
#include <stats/certified_maha.hpp>
#include <stats/certified_mean.hpp>
#include <stats/noise_fit.hpp>
#include <stats/random.hpp>
#include <stats/sampling.hpp>
#include <stats/summarized_mean.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace liestat;

constexpr double pi = static_cast<double>(EIGEN_PI);

/// A covariance of deviations between sd/3 and sd, in random directions.
template <class M>
SquareOf<M> randomCovariance(double sd, CounterRng& rng) {
  SquareOf<M> A;
  for (Eigen::Index i = 0; i < A.size(); ++i) A.data()[i] = rng.normal();
  const SquareOf<M> C = A * A.transpose() / ManifoldTraits<M>::DoF + 0.1 * SquareOf<M>::Identity();
  return sd * sd * C / C.diagonal().maxCoeff();
}
template <class M>
bool isotropic() {
  return ManifoldTraits<M>::Group::DoF != ManifoldTraits<M>::DoF;
}

/// So many of n trials or more happen with a probability above 1e-4 where each has the probability p.
double binomialBound(double n, double p) {
  double tail = 1, term = std::pow(1 - p, n);
  for (double k = 0; k <= n; ++k) {
    tail -= term;
    if (tail < 1e-4) return k;
    term *= (n - k) / (k + 1) * p / (1 - p);
  }
  return n;
}

struct Counts {
  int trials = 0, refuted = 0, ok = 0;
  void add(Status status) { ++trials, refuted += status == Status::inconsistent, ok += status == Status::ok; }
};

/// Measurements of the origin by noise of these covariances, stated `understated` times too small.
template <class M>
struct Scene {
  std::vector<M> features;
  std::vector<SquareOf<M>> stated;
  std::vector<double> weights;
  std::vector<Gaussian<M>> gaussians;

  Scene(int n, double sd, double understated, CounterRng& rng) {
    for (int i = 0; i < n; ++i) {
      const SquareOf<M> V = randomCovariance<M>(sd, rng);
      // On the sphere the noise is that of the measurement's frame, which is not that of the truth far from it.
      const SquareOf<M> there = isotropic<M>() ? SquareOf<M>(V(0, 0) * SquareOf<M>::Identity()) : V;
      features.push_back(sample(Gaussian<M>{ManifoldTraits<M>::origin(), there}, rng));
      stated.push_back(there / (understated * understated));
      weights.push_back(static_cast<double>(scalarWeight(there)));
      gaussians.push_back({features.back(), stated.back()});
    }
  }
};

template <class M>
void addAll(std::vector<std::pair<std::string, Counts>>& all, const std::string& feature, int n, double sd,
            double understated, int trials, std::uint64_t seed) {
  Counts lsq, wlsq, maha, fused;
  for (int t = 0; t < trials; ++t) {
    CounterRng rng(seed, static_cast<std::uint64_t>(t));
    const Scene<M> scene(n, sd, understated, rng);
    const auto at = isotropic<M>() ? CovarianceAt::measured : CovarianceAt::estimated;
    if constexpr (Metric<M>) {
      CertifiedMeanOptions<M> how;
      how.known_noise = scene.stated;
      lsq.add(certifiedMean(scene.features, how).status);
      wlsq.add(certifiedMean(scene.features, scene.weights, how).status);
    } else {
      CertifiedGroupMeanOptions<M> how;
      how.known_noise = scene.stated;
      lsq.add(certifiedGroupMean(scene.features, how).status);
      wlsq.add(certifiedGroupMean(scene.features, scene.weights, how).status);
    }
    maha.add(certifiedMaha(scene.gaussians, at).status);
    fused.add(testedFuse(scene.gaussians, at).status);
  }
  const std::string name = feature + ", n = " + std::to_string(n) + ", ";
  all.emplace_back(name + "lsq", lsq);
  all.emplace_back(name + "wlsq", wlsq);
  all.emplace_back(name + "maha", maha);
  all.emplace_back(name + "fuse", fused);
}

std::vector<std::pair<std::string, Counts>> everyFeature(int n, double sd, double understated, int trials) {
  std::vector<std::pair<std::string, Counts>> all;
  addAll<Eigen::Vector3d>(all, "points", n, sd, understated, trials, 1);
  addAll<SO3d>(all, "rotations", n, sd, understated, trials, 2);
  addAll<S2d>(all, "directions", n, sd, understated, trials, 3);
  addAll<Frame3d>(all, "frames", n, sd, understated, trials, 4);
  addAll<SemiOrientedFrame3d>(all, "semi-oriented frames", n, sd, understated, trials, 5);
  addAll<NonOrientedFrame3d>(all, "non-oriented frames", n, sd, understated, trials, 6);
  addAll<SE3d>(all, "poses", n, sd, understated, trials, 7);
  return all;
}

TEST(StatedNoise, rightNoiseIsNotRefuted) {
  for (const int n : {2, 5, 30}) {
    for (const double sd : {0.02, 0.2}) {
      constexpr int trials = 150;
      Counts together;
      for (const auto& [name, counts] : everyFeature(n, sd, 1, trials)) {
        EXPECT_LE(counts.refuted, binomialBound(trials, refutation_level)) << name << ", sd " << sd;
        together.refuted += counts.refuted, together.trials += counts.trials;
      }
      // The trials of one scene hang together, four criteria each.
      EXPECT_LE(together.refuted, 4 * binomialBound(together.trials / 4, refutation_level)) << n << ", sd " << sd;
    }
  }
}

TEST(StatedNoise, noiseThatIsTooSmallIsRefuted) {
  // χ²/ν of 4, 10 and 100 where at least 40, 15 and 6 degrees of freedom can see it: ok in none.
  const struct {
    int n;
    double understated;
  } rows[] = {{22, 2}, {9, std::sqrt(10)}, {4, 10}};
  for (const auto& row : rows) {
    constexpr int trials = 60;
    for (const auto& [name, counts] : everyFeature(row.n, 0.05, row.understated, trials)) {
      EXPECT_LE(counts.ok, binomialBound(trials, 1e-3)) << name << ", understated " << row.understated;
    }
  }
}

/// Two clouds of 20 rotations with their true covariance, their centres this far apart.
std::vector<SO3d> twoClouds(double degrees, double sd, std::uint64_t trial) {
  CounterRng rng(11, trial);
  std::vector<SO3d> all;
  for (int i = 0; i < 40; ++i) {
    const Eigen::Vector3d e = sd * Eigen::Vector3d(rng.normal(), rng.normal(), rng.normal());
    all.push_back(SO3d::exp({0, 0, (i % 2 == 0 ? 0.5 : -0.5) * degrees * pi / 180}) * SO3d::exp(e));
  }
  return all;
}

TEST(StatedNoise, twoCloudsRefuteTheNoiseOfEach) {
  for (const double degrees : {180.0, 179.5, 179.0, 178.0, 90.0}) {
    for (std::uint64_t t = 0; t < 60; ++t) {
      const std::vector<SO3d> clouds = twoClouds(degrees, 0.05, t);
      const Eigen::Matrix3d V = 0.05 * 0.05 * Eigen::Matrix3d::Identity();
      CertifiedMeanOptions<SO3d> how;
      how.known_noise = {V};
      const auto lsq = certifiedMean(clouds, how);
      EXPECT_EQ(lsq.status, Status::inconsistent) << degrees;
      EXPECT_FALSE(lsq.estimate);
      // The residual covariance, on request, is that of a mean without stated noise.
      how.refuted_noise = RefutedNoise::residuals;
      const auto residuals = certifiedMean(clouds, how);
      EXPECT_EQ(residuals.status, certifiedMean(clouds).status) << degrees;
      EXPECT_FALSE(residuals.from_noise);
      std::vector<Gaussian<SO3d>> measured;
      for (const SO3d& x : clouds) measured.push_back({x, V});
      const auto maha = certifiedMaha(measured, CovarianceAt::measured);
      EXPECT_EQ(maha.status, Status::inconsistent) << degrees;
      EXPECT_GT(maha.fit.factor(), 50);
    }
  }
}

TEST(StatedNoise, farApartMeasurementsAreNotFused) {
  const Eigen::Matrix3d V = 1e-4 * Eigen::Matrix3d::Identity();
  std::vector<Gaussian<SO3d>> three;
  for (const double angle : {0.0, 0.5, 1.0}) three.push_back({SO3d::exp({0, angle, 0}), V});
  const auto tested = testedFuse(three);
  EXPECT_EQ(tested.status, Status::inconsistent);
  EXPECT_TRUE(tested.estimate.covariance.allFinite());
  EXPECT_NEAR(tested.fit.chi2, 2 * 0.25 / 1e-4, 1e-6);
  EXPECT_EQ(tested.fit.degrees_of_freedom, 6);
  EXPECT_FALSE(fuse(three).covariance.allFinite());
  EXPECT_LT((fuse(three).mean.inverse() * SO3d::exp({0, 0.5, 0})).log().norm(), 1e-9);
}

TEST(StatedNoise, aSingleMeasurementKeepsItsCovariance) {
  CounterRng rng(5, 0);
  const SquareOf<SO3d> V = randomCovariance<SO3d>(0.1, rng);
  const SO3d x = SO3d::exp({0.3, 2, -1});
  CertifiedMeanOptions<SO3d> how;
  how.known_noise = {V};
  const auto mean = certifiedMean(std::vector{x}, how);
  ASSERT_EQ(mean.status, Status::ok);
  EXPECT_FALSE(mean.fit.tested());
  EXPECT_LT((mean.estimate->covariance - V).norm(), 1e-14);
  const auto maha = certifiedMaha(std::vector<Gaussian<SO3d>>{{x, V}}, CovarianceAt::measured);
  ASSERT_EQ(maha.status, Status::ok);
  EXPECT_FALSE(maha.fit.tested());
  EXPECT_LT((maha.estimate->covariance - V).norm(), 1e-14);
  CertifiedGroupMeanOptions<SE3d> poses;
  const SquareOf<SE3d> of_pose = randomCovariance<SE3d>(0.1, rng);
  poses.known_noise = {of_pose};
  const auto barycentre = certifiedGroupMean(std::vector{SE3d(x, {1, 2, 3})}, poses);
  ASSERT_EQ(barycentre.status, Status::ok);
  EXPECT_LT((barycentre.estimate->covariance - of_pose).norm(), 1e-12);
}

/// χ² about the minimum, not about the least-squares mean: covariances that differ by powers of ten show the
/// difference.
TEST(StatedNoise, chiSquareIsThatOfTheMinimum) {
  Counts counts;
  double sum = 0, sum_of_maha = 0;
  constexpr int n = 6, trials = 400;
  for (int t = 0; t < trials; ++t) {
    CounterRng rng(21, static_cast<std::uint64_t>(t));
    std::vector<SO3d> features;
    std::vector<Gaussian<SO3d>> measured;
    CertifiedMeanOptions<SO3d> how;
    for (int i = 0; i < n; ++i) {
      const Eigen::Matrix3d V = std::pow(10, -i % 3) * randomCovariance<SO3d>(0.1, rng);
      features.push_back(sample(Gaussian<SO3d>{SO3d(), V}, rng));
      how.known_noise.push_back(V);
      measured.push_back({features.back(), V});
    }
    const auto found = certifiedMean(features, how);
    counts.add(found.status);
    sum += found.fit.chi2;
    sum_of_maha += certifiedMaha(measured, CovarianceAt::measured).fit.chi2;
  }
  EXPECT_LE(counts.refuted, binomialBound(trials, refutation_level));
  constexpr double dof = 3 * (n - 1);
  EXPECT_NEAR(sum / trials, dof, 4 * std::sqrt(2 * dof / trials));
  EXPECT_NEAR(sum, sum_of_maha, 1e-5 * sum);
}

TEST(StatedNoise, birgesFactorWidens) {
  // Understated by 1.5 in deviation at ten rotations: rarely refuted, and wrong without the factor.
  int ok = 0, inside_plain = 0, inside_scaled = 0;
  for (std::uint64_t t = 0; t < 400; ++t) {
    CounterRng rng(31, t);
    const Scene<SO3d> scene(4, 0.05, 1.5, rng);
    CertifiedMahaOptions<SO3d> how;
    const auto plain = certifiedMaha(scene.gaussians, CovarianceAt::measured, how);
    how.scale_noise = true;
    const auto scaled = certifiedMaha(scene.gaussians, CovarianceAt::measured, how);
    ASSERT_EQ(plain.status, scaled.status);
    if (plain.status != Status::ok) continue;
    ++ok;
    EXPECT_LT((scaled.estimate->covariance - scaled.fit.factor() * plain.estimate->covariance).norm(),
              1e-12 * scaled.estimate->covariance.norm());
    inside_plain += mahalanobisSquared(*plain.estimate, SO3d()) < 7.815;
    inside_scaled += mahalanobisSquared(*scaled.estimate, SO3d()) < 7.815;
  }
  EXPECT_GT(ok, 200);
  EXPECT_LT(inside_plain, 0.9 * ok);
  EXPECT_GT(inside_scaled, inside_plain + 0.03 * ok);
}

TEST(StatedNoise, summariesSayWhatWasTested) {
  CounterRng rng(41, 0);
  const Scene<SO3d> scene(30, 0.3, 300, rng);
  MeanInput<SO3d> input{.criterion = Criterion::lsq, .features = scene.features, .covariances = scene.stated};
  for (const bool certificates : {true, false}) {
    for (const Criterion criterion : {Criterion::lsq, Criterion::maha}) {
      input.criterion = criterion;
      const MeanSummary mean = summarizedMean(SerialExecutor{}, input, {.certificates = certificates});
      EXPECT_EQ(mean.status, Status::inconsistent);
      EXPECT_FALSE(mean.hasCovariance());
      EXPECT_TRUE(mean.verdict().isNo());
      EXPECT_EQ(mean.fit.degrees_of_freedom, 87);
      EXPECT_NEAR(mean.fit.factor(), 9e4, 4 * 9e4 * std::sqrt(2.0 / 87));
    }
    input.criterion = Criterion::lsq;
    input.refuted_noise = RefutedNoise::residuals;
    const MeanSummary residuals = summarizedMean(SerialExecutor{}, input, {.certificates = certificates});
    EXPECT_EQ(residuals.status, Status::ok);
    EXPECT_TRUE(residuals.fromResiduals());
    EXPECT_TRUE(residuals.fit.refuted());
    input.refuted_noise = RefutedNoise::withheld;
  }
}

}  // namespace
