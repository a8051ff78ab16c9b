// Covariances from rows whose errors depend on time: right for independent and for Gauss–Markov errors, nothing made
// up.
#include <stats/random.hpp>
#include <stats/time_dependence.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace {

using namespace liestat;

constexpr int C = 6, P = 12;
using Rows = std::vector<TimedRow<C, P>>;
using Matrix = Eigen::Matrix<double, P, P>;

struct Drawn {
  Rows rows;
  Matrix plain;                          ///< of independent errors
  Eigen::Matrix<double, P, 1> estimate;  ///< the truth is zero
};

/// Rows of slowly moving columns, ten a second, with errors of unit variance and correlation `rho` from row to row;
/// those of the first `loud` channels are white and five times as large.
Drawn draw(int n, double rho, std::uint64_t trial, int loud = 0) {
  CounterRng rng(static_cast<std::uint64_t>(n), trial);
  Drawn drawn;
  Eigen::Matrix<double, C, 1> error = rng.normalVector<C>();
  Matrix information = Matrix::Zero();
  Eigen::Matrix<double, P, 1> right = Eigen::Matrix<double, P, 1>::Zero();
  for (int i = 0; i < n; ++i) {
    TimedRow<C, P>& row = drawn.rows.emplace_back();
    row.time = 0.1 * i;
    for (int c = 0; c < C; ++c) {
      for (int p = 0; p < P; ++p) {
        row.values(c, p) = (p == c ? 1 : 0) + (p < C ? 0 : std::sin(0.3 * (p + c) + 0.02 * (p + 1) * i));
      }
    }
    if (i > 0) error = rho * error + std::sqrt(1 - rho * rho) * rng.normalVector<C>();
    row.residual() = error;
    for (int c = 0; c < loud; ++c) row.values(c, P) = 5 * rng.normal();
    information += row.columns().transpose() * row.columns();
    right += row.columns().transpose() * row.residual();
  }
  drawn.plain = information.inverse();
  drawn.plain = 0.5 * (drawn.plain + drawn.plain.transpose()).eval();
  drawn.estimate = drawn.plain * right;
  for (TimedRow<C, P>& row : drawn.rows) row.residual() -= row.columns() * drawn.estimate;
  return drawn;
}

struct Mean {
  double plain = 0, widened = 0, width = 0;  ///< mean squared distances over P, and the mean factor of the deviations
};
Mean meanOf(int n, double rho, int trials) {
  Mean mean;
  for (int t = 0; t < trials; ++t) {
    const Drawn d = draw(n, rho, static_cast<std::uint64_t>(t));
    const TimedCovariance<P> timed = timedCovariance<C, P>(d.rows, d.plain, true);
    EXPECT_TRUE(timed.dependence.tested);
    mean.plain += d.estimate.dot(d.plain.ldlt().solve(d.estimate)) / P / trials;
    mean.widened += d.estimate.dot(timed.covariance.ldlt().solve(d.estimate)) / P / trials;
    mean.width += std::sqrt(timed.covariance.trace() / d.plain.trace()) / trials;
  }
  return mean;
}

TEST(TimeDependence, IndependentErrorsCostNothing) {
  for (const int n : {100, 300}) {
    const Mean m = meanOf(n, 0, 60);
    EXPECT_NEAR(m.widened, 1, 4 * std::sqrt(2.0 / P / 60)) << n;
    EXPECT_LT(m.width, 1.05) << n;
  }
}

TEST(TimeDependence, GaussMarkovErrorsAreCovered) {
  // Without it 11 to 72 times what is expected.
  struct {
    int n;
    double rho, plain;
  } const cells[] = {{100, 0.9, 5}, {300, 0.9, 5}, {300, 0.99, 20}};
  for (const auto& cell : cells) {
    const Mean m = meanOf(cell.n, cell.rho, 60);
    EXPECT_GT(m.plain, cell.plain) << cell.n << " " << cell.rho;
    EXPECT_LT(m.widened, 1.3) << cell.n << " " << cell.rho;
    EXPECT_GT(m.widened, 0.3) << cell.n << " " << cell.rho;
  }
}

// Loud channels are white, quiet ones last: one dependence for all would be that of the loud, 2.6 times too small.
TEST(TimeDependence, EachPrincipalAxisHasItsOwn) {
  constexpr int n = 300, trials = 40;
  double plain = 0, widened = 0;
  for (int t = 0; t < trials; ++t) {
    const Drawn d = draw(n, 0.99, static_cast<std::uint64_t>(t), 3);
    double squares = 0;
    for (const TimedRow<C, P>& row : d.rows) squares += row.residual().squaredNorm();
    const Matrix scaled = squares / (C * n - P) * d.plain;
    const TimedCovariance<P> timed = timedCovariance<C, P>(d.rows, scaled, false);
    plain += d.estimate.dot(scaled.ldlt().solve(d.estimate)) / P / trials;
    widened += d.estimate.dot(timed.covariance.ldlt().solve(d.estimate)) / P / trials;
    EXPECT_TRUE(timed.dependence.dependent());
  }
  EXPECT_GT(plain, 2);
  EXPECT_LT(widened, 1.3);
  EXPECT_GT(widened, 0.3);
}

// Noise known up to a factor states the ratios of sizes, which the residuals may refute, times or not.
TEST(TimeDependence, SizesThatAreNotInTheStatedRatiosAreTheirOwn) {
  constexpr int n = 60, trials = 100, loud = 2;
  double plain = 0, widened = 0;
  int found = 0, alarms = 0;
  for (int t = 0; t < trials; ++t) {
    for (const int channels : {0, loud}) {
      Drawn d = draw(n, 0, static_cast<std::uint64_t>(1000 + t), channels);
      for (TimedRow<C, P>& row : d.rows) row.time = 0;
      double squares = 0;
      for (const TimedRow<C, P>& row : d.rows) squares += row.residual().squaredNorm();
      const Matrix scaled = squares / (C * n - P) * d.plain;
      const TimedCovariance<P> timed = timedCovariance<C, P>(d.rows, scaled, false);
      EXPECT_FALSE(timed.dependence.tested);
      (channels == 0 ? alarms : found) += timed.dependence.unequal_axes;
      if (channels == 0) {
        EXPECT_EQ(timed.dependence.unequal_axes, timed.covariance != scaled);
        continue;
      }
      const auto of_loud = [&](const Matrix& covariance) {
        const Eigen::Matrix<double, loud, 1> off = d.estimate.head<loud>();
        return off.dot(covariance.topLeftCorner<loud, loud>().ldlt().solve(off)) / loud / trials;
      };
      plain += of_loud(scaled), widened += of_loud(timed.covariance);
    }
  }
  EXPECT_EQ(found, trials);
  EXPECT_LE(alarms, 2) << "of 100, at 1e-3";
  EXPECT_GT(plain, 1.8);
  EXPECT_NEAR(widened, 1, 4 * std::sqrt(2.0 / loud / trials));
}

TEST(TimeDependence, DoesNotDependOnTheOrderAndMakesNothingSmaller) {
  Drawn d = draw(60, 0.9, 1);
  const TimedCovariance<P> one = timedCovariance<C, P>(d.rows, d.plain, true);
  std::reverse(d.rows.begin(), d.rows.end());
  std::rotate(d.rows.begin(), d.rows.begin() + 17, d.rows.end());
  const TimedCovariance<P> two = timedCovariance<C, P>(d.rows, d.plain, true);
  EXPECT_EQ((one.covariance - two.covariance).norm(), 0);
  EXPECT_EQ(one.dependence.inWords(), two.dependence.inWords());
  EXPECT_EQ((one.covariance - one.covariance.transpose()).norm(), 0);
  const Matrix more = one.covariance - d.plain;
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Matrix>(more).eigenvalues()[0], -1e-12 * d.plain.norm());
  EXPECT_LT(one.dependence.white, 1e-6);
  EXPECT_NEAR(std::log(one.dependence.time_constant / 0.95), 0, std::log(4.0)) << "-0.1/log(0.9) s";
}

// A long list is computed again in each pass, in blocks; here from its end.
TEST(TimeDependence, ComputedRowsAreAsGoodAsKeptOnes) {
  const Drawn d = draw(5000, 0.9, 1, 2);
  const std::size_t n = d.rows.size();
  std::vector<double> times;
  for (std::size_t i = 0; i < n; ++i) times.push_back(d.rows[n - 1 - i].time);
  for (const bool known : {true, false}) {
    const TimedCovariance<P> kept = timedCovariance<C, P>(d.rows, d.plain, known);
    const TimedRows<C, P> computed(times,
                                   [&](std::size_t i, TimedRow<C, P>& row) { row.values = d.rows[n - 1 - i].values; });
    const TimedCovariance<P> streamed = timedCovariance<C, P>(computed, d.plain, known);
    EXPECT_GT(kept.dependence.correlation_factor, 2);
    EXPECT_LT((streamed.covariance - kept.covariance).norm(), 1e-12 * kept.covariance.norm());
    EXPECT_NEAR(streamed.dependence.time_constant, kept.dependence.time_constant, 1e-12);
  }
}

TEST(TimeDependence, WhatCannotBeTestedIsNot) {
  Drawn d = draw(60, 0, 1);
  const Rows few(d.rows.begin(), d.rows.begin() + 12);
  TimedCovariance<P> timed = timedCovariance<C, P>(few, d.plain, true);
  EXPECT_FALSE(timed.dependence.tested);
  EXPECT_EQ((timed.covariance - d.plain).norm(), 0);
  for (TimedRow<C, P>& row : d.rows) row.time = 5;
  EXPECT_FALSE((timedCovariance<C, P>(d.rows, d.plain, true).dependence.tested)) << "all at one time";
  d = draw(60, 0, 1);
  for (TimedRow<C, P>& row : d.rows) row.values.col(3).setZero();
  timed = timedCovariance<C, P>(d.rows, d.plain, true);
  EXPECT_FALSE(timed.dependence.tested) << "a parameter that is open";
  EXPECT_EQ((timed.covariance - d.plain).norm(), 0);
  // Rows in bursts: many times are equal, but for rounding.
  d = draw(60, 0, 1);
  for (TimedRow<C, P>& row : d.rows) row.time = std::floor(row.time);
  EXPECT_TRUE((timedCovariance<C, P>(d.rows, d.plain, true).covariance.allFinite()));
}

}  // namespace
