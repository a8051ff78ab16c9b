// The seven tests of whitened residuals: level on exact data, power against planted faults, invariance, bad input.

#include <stats/random.hpp>
#include <stats/whitened_residuals.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <vector>

namespace liestat {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

Matrix6 spd(CounterRng& rng) {
  Matrix6 A;
  for (int k = 0; k < 6; ++k) A.col(k) = rng.normalVector<6>();
  const Vector6 unit = (Vector6() << 0.05, 0.05, 0.05, 0.01, 0.01, 0.01).finished();
  const Matrix6 M = A * A.transpose() / 6 + 0.3 * Matrix6::Identity();
  return unit.asDiagonal() * M * unit.asDiagonal();
}
Matrix6 lower(const Matrix6& S) { return S.llt().matrixL(); }

/// Standard normal whitened residuals under random covariances.
std::vector<PoseResidual> exact(std::size_t n, CounterRng& rng) {
  std::vector<PoseResidual> residuals;
  for (std::size_t i = 0; i < n; ++i) {
    const Matrix6 S = spd(rng);
    residuals.push_back({lower(S) * rng.normalVector<6>(), S});
  }
  return residuals;
}

TEST(WhitenedResiduals, LevelsOnExactData) {
  // 4000 trials each; a binomial of rate 0.001 exceeds 12 of them with probability 3e-4, and of 0.01 (any) 66 with 4e-5.
  for (const std::size_t n : {std::size_t{20}, std::size_t{50}, std::size_t{200}}) {
    std::array<int, 7> fired{};
    int any = 0;
    const int trials = 4000;
    for (int trial = 0; trial < trials; ++trial) {
      CounterRng rng(11, static_cast<std::uint64_t>(trial), static_cast<std::uint32_t>(n));
      std::vector<PoseResidual> residuals(n);
      for (PoseResidual& r : residuals) r.error = rng.normalVector<6>();
      const WhitenedResidualTests tests = testWhitenedResiduals(residuals);
      const auto all = tests.all();
      for (std::size_t k = 0; k < 7; ++k) {
        ASSERT_TRUE(all[k].applies()) << name(static_cast<ResidualTestKind>(k));
        fired[k] += all[k].fires();
      }
      any += tests.anyFires();
    }
    for (std::size_t k = 0; k < 7; ++k) {
      EXPECT_LE(fired[k], 0.003 * trials) << name(static_cast<ResidualTestKind>(k)) << ", n = " << n;
    }
    EXPECT_LE(any, 0.01 * trials) << n;
    EXPECT_GT(any, 0) << n;
  }
}

TEST(WhitenedResiduals, AnyBasisOfTheErrorsGivesTheSame) {
  CounterRng rng(2);
  std::vector<PoseResidual> residuals = exact(60, rng), moved = residuals;
  // Blocks of positions and rotations are mixed within themselves, so that all seven tests are the same.
  Matrix6 B = Matrix6::Zero();
  for (int k = 0; k < 3; ++k) {
    B.col(k).head<3>() = rng.normalVector<3>(), B.col(k + 3).tail<3>() = rng.normalVector<3>();
  }
  for (PoseResidual& r : moved) r = {B * r.error, B * r.covariance * B.transpose()};
  const auto a = testWhitenedResiduals(residuals), b = testWhitenedResiduals(moved);
  EXPECT_NEAR(a.joint.statistic, b.joint.statistic, 1e-9 * a.joint.statistic);
  EXPECT_NEAR(a.position.statistic, b.position.statistic, 1e-9 * a.position.statistic);
  EXPECT_NEAR(a.rotation.statistic, b.rotation.statistic, 1e-9 * a.rotation.statistic);
  EXPECT_EQ(a.tail.statistic, b.tail.statistic);
}

/// Shares of trials in which a test fires.
double power(ResidualTestKind kind, std::size_t n,
             const std::function<void(std::vector<PoseResidual>&, CounterRng&)>& spoil, int trials = 300) {
  int fired = 0;
  for (int trial = 0; trial < trials; ++trial) {
    CounterRng rng(5, static_cast<std::uint64_t>(trial));
    std::vector<PoseResidual> residuals = exact(n, rng);
    spoil(residuals, rng);
    fired += testWhitenedResiduals(residuals).all()[static_cast<std::size_t>(kind)].fires();
  }
  return fired / double(trials);
}

TEST(WhitenedResiduals, PowerAgainstPlantedFaults) {
  using Kind = ResidualTestKind;
  using Residuals = std::vector<PoseResidual>;
  const auto scaled = [](double position, double rotation) {
    return [=](Residuals& all, CounterRng&) {
      for (PoseResidual& r : all) {
        const Vector6 d = (Vector6() << Eigen::Vector3d::Constant(std::sqrt(position)),
                           Eigen::Vector3d::Constant(std::sqrt(rotation)))
                              .finished();
        r.covariance = d.asDiagonal() * r.covariance * d.asDiagonal();
      }
    };
  };
  // Three standard errors of 300 trials are 0.09 at most.
  EXPECT_NEAR(power(Kind::joint, 50, scaled(0.8, 0.8)), 0.31, 0.1);
  EXPECT_GT(power(Kind::joint, 200, scaled(0.8, 0.8)), 0.95);
  EXPECT_NEAR(power(Kind::rotation, 200, scaled(1, 0.8)), 0.78, 0.1);
  EXPECT_NEAR(power(Kind::rotation, 200, scaled(1.2, 0.8)), 0.66, 0.13);
  const auto biased = [](Residuals& all, CounterRng&) {
    for (PoseResidual& r : all) r.error += 0.3 * lower(r.covariance).col(0);
  };
  EXPECT_NEAR(power(Kind::mean, 200, biased), 0.54, 0.12);
  // A cross block of correlation 0.4 between a position and a rotation, dropped from the file.
  const auto dropped = [](Residuals& all, CounterRng& rng) {
    Matrix6 S = Matrix6::Identity();
    for (int k = 0; k < 3; ++k) S(k, k + 3) = S(k + 3, k) = 0.4;
    for (PoseResidual& r : all) r = {lower(S) * rng.normalVector<6>(), Matrix6::Identity()};
  };
  EXPECT_GT(power(Kind::covariance, 200, dropped), 0.75);
  EXPECT_LT(power(Kind::joint, 200, dropped), 0.05);
  const auto heavy = [](Residuals& all, CounterRng& rng) {  // Student's t with 5 degrees of freedom, unit variance
    for (PoseResidual& r : all) r.error *= std::sqrt(3 / rng.normalVector<5>().squaredNorm());
  };
  EXPECT_NEAR(power(Kind::tail, 200, heavy), 0.88, 0.12);
  const auto correlated = [](double a) {
    return [a](Residuals& all, CounterRng& rng) {
      Vector6 z = rng.normalVector<6>();
      for (PoseResidual& r : all) {
        r.error = lower(r.covariance) * z;
        z = a * z + std::sqrt(1 - a * a) * rng.normalVector<6>();
      }
    };
  };
  EXPECT_NEAR(power(Kind::lag, 50, correlated(0.3)), 0.90, 0.1);
  EXPECT_EQ(power(Kind::lag, 50, correlated(0.9)), 1);
  // The lag test does not depend on the covariances.
  EXPECT_EQ(power(Kind::lag, 50,
                  [&](Residuals& all, CounterRng& rng) { correlated(0.9)(all, rng), scaled(4, 0.1)(all, rng); }),
            1);
  EXPECT_LT(power(Kind::lag, 50, scaled(4, 0.1)), 0.02);
}

TEST(WhitenedResiduals, BadInputIsSaid) {
  EXPECT_FALSE(testWhitenedResiduals({}).joint.applies());
  CounterRng rng(3);
  std::vector<PoseResidual> residuals = exact(30, rng);
  residuals[7].covariance(2, 2) = -1;
  residuals[9].covariance(0, 0) = std::numeric_limits<double>::quiet_NaN();
  const auto tests = testWhitenedResiduals(residuals);
  EXPECT_EQ(tests.indefinite, 2u);
  for (const ResidualTest& test : tests.all()) EXPECT_FALSE(test.applies());
  EXPECT_FALSE(tests.consistent());
  // Few residuals: NEES is exact, what needs more is not said.
  residuals = exact(1, rng);
  const auto one = testWhitenedResiduals(residuals);
  EXPECT_TRUE(one.joint.applies());
  EXPECT_FALSE(one.lag.applies());
  EXPECT_FALSE(one.covariance.applies());
  for (int k = 0; k < 7; ++k) {
    EXPECT_STRNE(cause(static_cast<ResidualTestKind>(k), true), "");
    EXPECT_STRNE(name(static_cast<ResidualTestKind>(k)), "");
  }
}

}  // namespace
}  // namespace liestat
