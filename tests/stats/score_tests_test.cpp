// Named suspects: what is planted is found with the deviation that is claimed, what is not is no alarm under dependent
// errors either, and a suspect that is an unknown, with a prior or without, is estimated by least squares.
#include <stats/random.hpp>
#include <stats/score_tests.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace {

using namespace liestat;

constexpr int C = 3, P = 4, G = 3, N = P + G;
using Rows = std::vector<TimedRow<C, N>>;
using Matrix = Eigen::Matrix<double, N, N>;
using Vector = Eigen::Matrix<double, N, 1>;

struct Drawn {
  Rows rows;                          ///< residuals of a fit of the parameters alone
  Eigen::Matrix<double, P, 1> off;    ///< of the parameters' estimate
  Eigen::Matrix<double, P, P> plain;  ///< its covariance under independent errors
};

/// Ten rows a second whose parameters and suspects change at different paces; the last two suspects do nearly the same.
Drawn draw(int n, double rho, const Eigen::Vector3d& planted, std::uint64_t trial, double sigma = 1) {
  CounterRng rng(static_cast<std::uint64_t>(n), trial);
  Drawn d;
  Eigen::Matrix<double, P, P> information = Eigen::Matrix<double, P, P>::Zero();
  Eigen::Matrix<double, P, 1> right = Eigen::Matrix<double, P, 1>::Zero();
  Eigen::Vector3d error = rng.normalVector<C>();
  for (int i = 0; i < n; ++i) {
    TimedRow<C, N>& row = d.rows.emplace_back();
    row.time = 0.1 * i;
    for (int c = 0; c < C; ++c) {
      for (int p = 0; p < P; ++p) row.values(c, p) = p == c ? 1 : std::sin(0.4 * (p + c) + 0.03 * (p + 1) * i);
      row.values(c, P) = std::cos(1.3 * c + 0.23 * i);
      row.values(c, P + 1) = std::cos(0.7 * c + 0.19 * i);
      row.values(c, P + 2) = row.values(c, P + 1) + 0.05 * std::sin(0.9 * c + 0.31 * i);
    }
    if (i > 0) error = rho * error + std::sqrt(1 - rho * rho) * rng.normalVector<C>();
    row.residual() = sigma * error - row.columns().rightCols<G>() * planted;
    information += row.columns().leftCols<P>().transpose() * row.columns().leftCols<P>();
    right += row.columns().leftCols<P>().transpose() * row.residual();
  }
  d.plain = information.inverse();
  d.off = -d.plain * right;
  for (TimedRow<C, N>& row : d.rows) row.residual() += row.columns().leftCols<P>() * d.off;
  return d;
}

TEST(ScoreTests, FindWhatIsPlantedWithTheDeviationThatTheyClaim) {
  constexpr int trials = 200;
  // 0.5 of a standard deviation of a row, which a χ² of 300 degrees of freedom hardly sees.
  const Eigen::Vector3d planted(0.5, 0, 0);
  for (const bool known : {true, false}) {
    double squares = 0, found = 0;
    for (std::uint64_t t = 0; t < trials; ++t) {
      const Drawn d = draw(100, 0, planted, t, known ? 1 : 2);
      const auto tests = scoreTests<C, P, G>(d.rows, {.known_noise = known});
      const SuspectTest& test = tests.suspects[0];
      squares += std::pow((test.estimate - 0.5) / test.sigma, 2) / trials;
      found += tests.strongest == 0 ? 1.0 / trials : 0;
      EXPECT_NEAR(test.sigma, (known ? 1 : 2) / std::sqrt(0.5 * C * 100), 0.02 * (known ? 1 : 2));
    }
    EXPECT_NEAR(squares, 1, 4 * std::sqrt(2.0 / trials));
    EXPECT_GT(found, known ? 0.97 : 0.2) << "six standard deviations; three if the noise is twice as large";
  }
}

TEST(ScoreTests, FalseAlarmsAreRareWhateverTheDependence) {
  constexpr int trials = 300;
  for (const double rho : {0.0, 0.9, 0.99}) {
    int alarms = 0;
    for (std::uint64_t t = 0; t < trials; ++t) {
      alarms += scoreTests<C, P, G>(draw(200, rho, Eigen::Vector3d::Zero(), t).rows, {}).strongest >= 0;
    }
    // Binomial: twelve of 300 at 1.5 % have the probability 1e-3.
    EXPECT_LE(alarms, 11) << rho;
  }
}

TEST(ScoreTests, SuspectsThatDoTheSameStayInTheAnswerTogether) {
  int together = 0, covered = 0, detected = 0;
  for (std::uint64_t t = 0; t < 100; ++t) {
    const Drawn d = draw(100, 0, Eigen::Vector3d(0, 0.6, 0), t);
    const auto tests = scoreTests<C, P, G>(d.rows, {});
    if (tests.strongest < 0) continue;
    ++detected;
    EXPECT_FALSE(tests.suspects[0].in_group);
    together += tests.suspects[1].in_group && tests.suspects[2].in_group;
    // The mixture has the error of the parameters within its covariance.
    const auto [step, covariance] = groupMixture(tests, d.plain);
    const Eigen::Matrix<double, P, 1> off = d.off + step;
    covered += off.dot(covariance.ldlt().solve(off)) < 13.28;  // χ²₄ at 0.99
    EXPECT_GE((covariance - d.plain).trace(), 0);
  }
  EXPECT_GE(detected, 95);
  EXPECT_GE(together, 90);
  EXPECT_GE(covered, detected - 6);
}

TEST(ScoreTests, UnknownsWithAndWithoutPriorsAreThoseOfLeastSquares) {
  const double infinite = std::numeric_limits<double>::infinity();
  const Drawn d = draw(60, 0, Eigen::Vector3d(0.3, 0, 0), 7);
  // The second suspect is at 0.2 already, with a prior; the third keeps its value.
  const auto tests =
      scoreTests<C, P, G>(d.rows, {.prior_sigmas = {infinite, 0.1, 0}, .values = {0, 0.2, 0}, .known_noise = false});
  constexpr int K = P + 2;
  Eigen::Matrix<double, K, K> H = Eigen::Matrix<double, K, K>::Zero();
  Eigen::Matrix<double, K, 1> g = Eigen::Matrix<double, K, 1>::Zero();
  Matrix all = Matrix::Zero();
  Vector right = Vector::Zero();
  double squares = 0;
  for (const auto& row : d.rows) {
    all += row.columns().transpose() * row.columns(), right += row.columns().transpose() * row.residual();
    H += row.columns().leftCols<K>().transpose() * row.columns().leftCols<K>();
    g += row.columns().leftCols<K>().transpose() * row.residual();
    squares += row.residual().squaredNorm();
  }
  // The noise is what all suspects together leave.
  const double variance = (squares - right.dot(all.ldlt().solve(right))) / (C * 60.0 - N);
  const Eigen::Matrix<double, K, K> of_rows = H;
  H(P + 1, P + 1) += 100, g[P + 1] += 100 * 0.2;
  const Eigen::Matrix<double, K, 1> step = -H.ldlt().solve(g);
  EXPECT_LT((tests.step.head<K>() - step).norm(), 1e-12);
  EXPECT_EQ(tests.step[K], 0);
  Eigen::Matrix<double, K, K> spread = variance * of_rows;
  spread(P + 1, P + 1) += 100;
  const Eigen::Matrix<double, K, K> covariance = H.inverse() * spread * H.inverse();
  EXPECT_LT((tests.covariance.topLeftCorner<K, K>() - covariance).norm(), 1e-12);
  EXPECT_EQ(tests.covariance.rightCols<1>().norm(), 0);
  // An unknown without a prior and its test are one number; the third does what the second does.
  EXPECT_NEAR(tests.suspects[0].estimate, step[P], 1e-12);
  EXPECT_NEAR(tests.suspects[0].sigma, std::sqrt(covariance(P, P)), 1e-12);
  // The estimate that a prior takes part in lies between zero and that of the residuals.
  EXPECT_NEAR(tests.suspects[1].z, tests.suspects[1].estimate / std::hypot(tests.suspects[1].sigma, 0.1), 1e-12);
}

TEST(ScoreTests, CommonEstimatesAreCoveredUnderDependenceToo) {
  constexpr int trials = 100;
  const double infinite = std::numeric_limits<double>::infinity();
  for (const double rho : {0.0, 0.9}) {
    double nees = 0, without = 0;
    for (std::uint64_t t = 0; t < trials; ++t) {
      const Drawn d = draw(200, rho, Eigen::Vector3d(0.5, 0, 0), t);
      const auto tests = scoreTests<C, P, G>(d.rows, {.prior_sigmas = {infinite, 0, 0}});
      Eigen::Matrix<double, P + 1, 1> off;
      off << d.off + tests.step.head<P>(), tests.step[P] - 0.5;
      nees += off.dot(tests.covariance.topLeftCorner<P + 1, P + 1>().ldlt().solve(off)) / (P + 1) / trials;
      without += d.off.dot(d.plain.ldlt().solve(d.off)) / P / trials;
    }
    EXPECT_LT(nees, rho > 0 ? 1.5 : 1 + 4 * std::sqrt(2.0 / (P + 1) / trials)) << rho;
    EXPECT_GT(nees, rho > 0 ? 0.3 : 1 - 4 * std::sqrt(2.0 / (P + 1) / trials)) << rho;
    if (rho > 0) {
      EXPECT_GT(without, 4);
    }
  }
}

TEST(ScoreTests, WhatTheParametersExplainIsNotTested) {
  Drawn d = draw(60, 0, Eigen::Vector3d::Zero(), 3);
  for (auto& row : d.rows) {
    row.values.col(P) = row.columns().col(0) - 2 * row.columns().col(2);
    row.values.col(P + 1).setZero();
    row.time = 0;
  }
  const auto tests = scoreTests<C, P, G>(d.rows, {});
  EXPECT_FALSE(tests.suspects[0].tested());
  EXPECT_FALSE(tests.suspects[1].tested()) << "a suspect without columns";
  EXPECT_TRUE(tests.suspects[2].tested());
  EXPECT_FALSE(tests.dependence.tested) << "no times";
  // A unit of it moves the parameters by what they do.
  EXPECT_LT((tests.shifts.col(0) - Eigen::Vector4d(-1, 0, 2, 0)).norm(), 1e-9);
  EXPECT_EQ((scoreTests<C, P, G>({}, {}).strongest), -1);
}

}  // namespace
