// Certificates of uniqueness on products: each part's minimum by itself. Seeds are fixed.

#include <stats/random.hpp>
#include <stats/sampling.hpp>
#include <stats/certified_mean.hpp>

#include <lie/lie.hpp>

#include <support/product_samples.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector2d;
using Eigen::Vector3d;
using liestat_test::parts, liestat_test::scattered;

TEST(ProductUniqueness, TightDataHaveAUniqueMean) {
  const auto samples = scattered<Product<Frame3d, Product<S2d, Vector2d>>>(12, 0.1);
  const auto result = mean(samples);
  const auto unique = uniqueness(samples, result);
  EXPECT_EQ(unique.unique, Uniqueness::unique);
  EXPECT_NEAR(unique.cost, result.cost, 1e-12);
  EXPECT_GT(unique.r_star, 0);
  const auto certified = certifiedMean(samples);
  ASSERT_EQ(certified.status, Status::ok) << certified.reason;
  EXPECT_LE((certified.estimate->covariance - covarianceFromResiduals(result)).norm(), 1e-14);
}

// Two opposite directions have a circle of means; the vector that goes with them has one.
TEST(ProductUniqueness, AmbiguityOfAPartIsTheProducts) {
  using M = Product<Vector2d, S2d>;
  const std::vector<M> samples = {{Vector2d(1, 2), S2d(1, 0, 0)}, {Vector2d(3, 4), S2d(-1, 0, 0)}};
  const auto result = uniqueness(samples, mean(samples));
  EXPECT_EQ(result.unique, Uniqueness::ambiguous);
  ASSERT_FALSE(result.rivals.empty());
  EXPECT_LE((result.rivals[0].get<0>() - Vector2d(2, 3)).norm(), 1e-12) << "rivals share the part that is unique";
  EXPECT_NEAR(std::abs(result.rivals[0].get<1>().unit_vector()[0]), 0, 1e-6);
  EXPECT_EQ(certifiedMean(samples).status, Status::ambiguous);
}

// Two parts with two minima each: the product has four.
TEST(ProductUniqueness, RivalsAreTheTuplesOfTheParts) {
  using M = Product<SO2d, SO2d>;
  const std::vector<M> samples = {{SO2d(0.0), SO2d(0.0)}, {SO2d(EIGEN_PI), SO2d(EIGEN_PI)}};
  const auto result = uniqueness(samples, mean(samples));
  EXPECT_EQ(result.unique, Uniqueness::ambiguous);
  EXPECT_EQ(result.rivals.size(), 3U);
  for (const M& rival : result.rivals) {
    double cost = 0;
    for (const M& x : samples) cost += std::pow(distance(rival, x), 2) / 2;
    EXPECT_NEAR(cost, result.cost, 1e-12);
  }
}

// Started in a wrong minimum of one part, the search finds the right one.
TEST(ProductUniqueness, AWrongMinimumIsImproved) {
  using M = Product<Vector2d, SO2d>;
  std::vector<M> samples;
  for (const double angle : {0.0, 0.1, 3.0, -2.4}) samples.push_back({Vector2d(angle, 1), SO2d(angle)});
  const auto best = mean(samples);
  int wrong = 0;
  for (const double start : {0.0, 1.0, 2.0, 3.0, -2.0, -1.0}) {
    MeanOptions<M> options;
    options.start = M(Vector2d::Zero(), SO2d(start));
    const auto found = mean(samples, options);
    const auto result = uniqueness(samples, found);
    EXPECT_EQ(result.unique, Uniqueness::unique);
    EXPECT_EQ(result.improved, result.cost < found.cost - 1e-9);
    wrong += result.improved;
    EXPECT_LE(result.cost, best.cost + 1e-12);
  }
  EXPECT_GT(wrong, 0);
}

// A covariance is withheld for the product where it is for the part, and for the same reason.
TEST(ProductUniqueness, APartThatIsWithheldWithholdsTheCovariance) {
  using M = Product<Vector3d, NonOrientedFrame3d>;
  const std::array<std::pair<double, Status>, 3> rows{
      {{0.3, Status::ok}, {0.9, Status::ambiguous}, {1.5, Status::ill_defined}}};
  for (const auto& [spread, expected] : rows) {
    const auto samples = scattered<M>(200, spread, 7);
    const auto whole = certifiedMean(samples);
    const auto part = certifiedMean(parts<1>(samples));
    EXPECT_EQ(whole.status, part.status);
    EXPECT_EQ(std::string(whole.reason), std::string(part.reason));
    EXPECT_EQ(part.status, expected) << spread << ": " << part.reason;
  }
}

}  // namespace
