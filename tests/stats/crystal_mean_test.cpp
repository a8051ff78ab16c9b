// Means of orientations of crystals: against brute force over all labels, from any copies, with covariance and
// refusals. Seeds are fixed.

#include <lie/crystal_orientation.hpp>
#include <stats/certified_mean.hpp>
#include <stats/random.hpp>
#include <stats/summarized_mean.hpp>
#include <support/crystal_labels.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

namespace {

using namespace liestat_test;
using Eigen::Vector3d;
using Traits = ManifoldTraits<CrystalOrientation>;

constexpr double pi = 3.14159265358979323846;

/// A random copy of an orientation.
CrystalOrientation copyOf(const SO3d& rotation, PointGroup group, CounterRng& rng) {
  const CrystalOrientation x(rotation, group);
  const auto copies = Traits::representativesOf(x);
  return Traits::representative(x,
                                copies[static_cast<std::size_t>(rng.uniform() * static_cast<double>(copies.size()))]);
}
/// Normal errors of this standard deviation about a rotation, as random copies.
std::vector<CrystalOrientation> scattered(std::uint64_t seed, std::uint64_t trial, PointGroup group, int n, double sd,
                                          SO3d* truth = nullptr) {
  CounterRng rng(seed, trial);
  const SO3d centre = uniformRotation(rng);
  std::vector<CrystalOrientation> list;
  for (int i = 0; i < n; ++i) list.push_back(copyOf(centre * SO3d::exp(sd * rng.normalVector<3>()), group, rng));
  if (truth != nullptr) *truth = centre;
  return list;
}

TEST(CrystalMean, threeOrientationsAreTheLeastOverAllLabels) { certifiedMeanIsTheLeastOverLabels(3, 40, 12); }
TEST(CrystalMean, fourOrientationsAreTheLeastOverAllLabels) { certifiedMeanIsTheLeastOverLabels(4, 12, 3); }
TEST(CrystalMean, copiesAndRotationsOfTheSampleChangeNothing) {
  for (const char* name : proper) {
    const PointGroup group = groupOf(name);
    const auto x = scattered(3, 1, group, 25, 0.08);
    CounterRng rng(4);
    std::vector<CrystalOrientation> copies, turned;
    const SO3d turn = uniformRotation(rng);
    for (const CrystalOrientation& o : x) {
      copies.push_back(copyOf(o.rotation(), group, rng));
      turned.push_back(act(turn, o));
    }
    const auto a = certifiedMean(x), b = certifiedMean(copies), c = certifiedMean(turned);
    ASSERT_EQ(a.status, Status::ok) << name;
    ASSERT_EQ(b.status, Status::ok) << name;
    ASSERT_EQ(c.status, Status::ok) << name;
    EXPECT_LT(distance(a.mean.mean, b.mean.mean), 1e-7);
    EXPECT_LT(distance(act(turn, a.mean.mean), c.mean.mean), 1e-7);
    // The mean is the copy of least angle, so the covariance is in the same axes.
    EXPECT_LT((a.mean.mean.rotation().inverse() * b.mean.mean.rotation()).log().norm(), 1e-7) << name;
    EXPECT_LT((a.estimate->covariance - b.estimate->covariance).norm(), 1e-9 * a.estimate->covariance.norm()) << name;
    EXPECT_EQ(a.mean.mean.group(), group);
  }
}

/// A cloud within the injectivity radius has the mean and the covariance of its nearest copies as rotations.
TEST(CrystalMean, ofACloudIsThatOfTheNearestCopies) {
  for (const char* name : proper) {
    const auto x = scattered(5, 2, groupOf(name), 30, 0.05);
    const auto found = certifiedMean(x);
    ASSERT_EQ(found.status, Status::ok) << name << " " << found.reason;
    std::vector<SO3d> copies;
    for (const CrystalOrientation& o : x) copies.push_back(o.nearestTo(found.mean.mean.rotation()));
    const auto rotations = certifiedMean(copies);
    EXPECT_LT((rotations.mean.mean.inverse() * found.mean.mean.rotation()).log().norm(), 1e-11);
    EXPECT_LT((rotations.estimate->covariance - found.estimate->covariance).norm(),
              1e-9 * rotations.estimate->covariance.norm());
    EXPECT_EQ(found.uniqueness.unique, Uniqueness::unique) << name;
  }
}

/// The 95 % region of what is ok holds the truth in 93 % at least (four standard errors of 400), at noise that reaches
/// the cut loci (a third of the injectivity radius as standard deviation of each axis) and at less.
TEST(CrystalMean, covariancesHold) {
  for (const char* name : {"2", "3", "432", "622"}) {
    for (const double part : {0.1, 1.0 / 3}) {
      const PointGroup group = groupOf(name);
      const double sd = part * 0.5 * group.leastAngle();
      int ok = 0, inside = 0;
      constexpr int trials = 400, n = 20;
      for (int t = 0; t < trials; ++t) {
        SO3d truth;
        const auto x = scattered(6, static_cast<std::uint64_t>(t), group, n, sd, &truth);
        const auto found = certifiedMean(x);
        if (!found.estimate) continue;
        ++ok;
        const Vector3d error = log(found.mean.mean, CrystalOrientation(truth, group));
        const double t2 = error.dot(found.estimate->covariance.inverse() * error);
        inside += detail::hotellingTail(t2, 3, found.law_n) >= 0.05;
      }
      // Within four standard errors of 0.93.
      if (ok > 40) {
        EXPECT_GE(inside, 0.93 * ok - 4 * std::sqrt(0.07 * 0.93 * ok)) << name << " sd " << sd << " ok " << ok;
      }
      if (part < 0.2) {
        EXPECT_EQ(ok, trials) << name;
      }
    }
  }
}

TEST(CrystalMean, uniformOrientationsHaveNone) {
  // A rival that is there is found early.
  CertifiedMeanOptions<CrystalOrientation> options;
  options.uniqueness.budget = 200'000;
  for (const char* name : proper) {
    int ok = 0;
    for (std::uint64_t t = 0; t < 40; ++t) {
      CounterRng rng(7, t);
      std::vector<CrystalOrientation> x;
      for (int i = 0; i < 30; ++i) x.emplace_back(uniformRotation(rng), groupOf(name));
      ok += certifiedMean(x, options).status == Status::ok;
    }
    // 0.01 of them by the level of the test: more than three of 40 have a probability of 1e-3 over all ten groups.
    EXPECT_LE(ok, 3) << name;
  }
}

/// Two clouds with a third between them of another label: half of the data 45 degrees about z from the others are as
/// near by either way round in 432, but not in 222.
TEST(CrystalMean, rivalsByTheGroupAreNamed) {
  CounterRng rng(8);
  std::vector<SO3d> rotations;
  for (int i = 0; i < 20; ++i) {
    rotations.push_back(SO3d::exp(Vector3d(0, 0, i % 2 == 0 ? 0 : pi / 4)) * SO3d::exp(0.02 * rng.normalVector<3>()));
  }
  const auto status = [&](const char* name) {
    std::vector<CrystalOrientation> x;
    for (const SO3d& r : rotations) x.emplace_back(r, groupOf(name));
    return certifiedMean(x).status;
  };
  EXPECT_EQ(status("432"), Status::ambiguous);
  EXPECT_EQ(status("4"), Status::ambiguous);
  EXPECT_EQ(status("222"), Status::ok);
  EXPECT_EQ(status("1"), Status::ok);
}

TEST(CrystalMean, summariesNameTheGroupAndRefuseWhatTheyCannot) {
  auto x = scattered(9, 1, groupOf("m-3m"), 12, 0.05);
  const MeanInput<CrystalOrientation> input{.features = x};
  const MeanSummary found = summarizedMean(SerialExecutor{}, input);
  EXPECT_EQ(found.status, Status::ok);
  EXPECT_EQ(found.symmetry, "432");
  EXPECT_EQ(found.covariance.rows(), 3);
  MeanInput<CrystalOrientation> maha = input;
  maha.criterion = Criterion::maha;
  maha.covariances = {Eigen::Matrix3d::Identity()};
  EXPECT_EQ(summarizedMean(SerialExecutor{}, maha).status, Status::not_applicable);
  x.back() = CrystalOrientation(x.back().rotation(), groupOf("622"));
  const MeanSummary mixed = summarizedMean(SerialExecutor{}, input);
  EXPECT_EQ(mixed.status, Status::not_applicable);
  EXPECT_EQ(mixed.reason, "orientations of several point groups");
}

TEST(CrystalMean, weightsAndKnownNoise) {
  const auto x = scattered(10, 1, groupOf("622"), 6, 0.03);
  std::vector<CrystalOrientation> repeated(x);
  repeated.push_back(x[0]);
  std::vector<double> weights(x.size(), 1.0);
  weights[0] = 2;
  const auto weighted = certifiedMean(x, weights);
  EXPECT_LT(distance(weighted.mean.mean, certifiedMean(repeated).mean.mean), 1e-7);
  CertifiedMeanOptions<CrystalOrientation> known;
  known.known_noise = {Eigen::Matrix3d(0.03 * 0.03 * Eigen::Matrix3d::Identity())};
  const auto from_noise = certifiedMean(x, known);
  ASSERT_TRUE(from_noise.estimate);
  EXPECT_TRUE(from_noise.from_noise);
  EXPECT_NEAR(from_noise.estimate->covariance.trace(), 3 * 0.0009 / 6, 0.01 * 3 * 0.0009 / 6);
}

}  // namespace
