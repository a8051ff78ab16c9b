// The Kolmogorov-Smirnov law against published values, closed forms, an evaluation in fifty digits and a simulation.

#include <stats/kolmogorov.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <boost/multiprecision/cpp_bin_float.hpp>

#include <chrono>
#include <cmath>
#include <limits>
#include <vector>

namespace {

using namespace liestat;

const double nan = std::numeric_limits<double>::quiet_NaN();
const double inf = std::numeric_limits<double>::infinity();

// Durbin's matrix power as Marsaglia, Tsang and Wang write it, in fifty digits: the whole matrix, by repeated squaring.
using Real = boost::multiprecision::number<boost::multiprecision::cpp_bin_float<50>, boost::multiprecision::et_off>;
using Square = std::vector<std::vector<Real>>;

Square product(const Square& a, const Square& b) {
  const std::size_t m = a.size();
  Square c(m, std::vector<Real>(m, Real(0)));
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t k = 0; k < m; ++k)
      for (std::size_t j = 0; j < m; ++j) c[i][j] += a[i][k] * b[k][j];
  return c;
}

Real referenceCdf(std::size_t n, double d) {
  const Real nd = Real(n) * Real(d);
  const auto k = static_cast<std::size_t>(nd) + 1;
  const std::size_t m = 2 * k - 1;
  const Real h = Real(k) - nd;
  std::vector<Real> factorial(m + 2, Real(1));
  for (std::size_t i = 1; i < factorial.size(); ++i) factorial[i] = factorial[i - 1] * Real(i);
  Square H(m, std::vector<Real>(m, Real(0)));
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j < m && j <= i + 1; ++j) H[i][j] = 1;
  Real power = 1;
  for (std::size_t i = 0; i < m; ++i) {
    power *= h;
    H[i][0] -= power;
    H[m - 1][m - 1 - i] -= power;
  }
  if (2 * h > 1) H[m - 1][0] += pow(2 * h - 1, static_cast<int>(m));
  for (std::size_t i = 0; i < m; ++i)
    for (std::size_t j = 0; j < m && j <= i + 1; ++j) H[i][j] /= factorial[i + 1 - j];

  Square power_of_h(m, std::vector<Real>(m, Real(0)));
  for (std::size_t i = 0; i < m; ++i) power_of_h[i][i] = 1;
  for (std::size_t left = n; left > 0; left /= 2) {
    if (left % 2 == 1) power_of_h = product(power_of_h, H);
    if (left > 1) H = product(H, H);
  }
  Real result = power_of_h[k - 1][k - 1];
  for (std::size_t i = 1; i <= n; ++i) result *= Real(i) / Real(n);
  return result;
}

TEST(Kolmogorov, givesThePublishedValues) {
  // Marsaglia, Tsang and Wang 2003, the example of the text and the digits found by independent programs.
  EXPECT_NEAR(kolmogorovCdf(10, 0.274), 0.6284796154565, 1e-13);
  EXPECT_NEAR(kolmogorovCdf(2000, 0.04), 0.99676943191713676985, 1e-13);
  EXPECT_NEAR(kolmogorovCdf(2000, 0.06), 0.99999893956930568118, 1e-15);
  // The published digits are those of a double next to one, so the tail is known to half a unit there.
  EXPECT_NEAR(kolmogorovPValue(2000, 0.06), 1.06043069431882e-6, 6e-17);
  EXPECT_NEAR(kolmogorovCdf(16000, 0.016), 0.99945234913828052085, 1e-9);
}

TEST(Kolmogorov, agreesWithFiftyDigits) {
  for (std::size_t n : {1u, 2u, 3u, 5u, 10u, 30u, 100u}) {
    for (double x : {0.25, 0.4, 0.6, 0.8, 1.1, 1.5, 1.9, 1.999}) {
      if (n > 50 && x > 1.2) continue;  // fifty digits are slow
      const double d = x / std::sqrt(static_cast<double>(n));
      if (d >= 1 || d * static_cast<double>(n) <= 0.5) continue;
      const Real reference = referenceCdf(n, d);
      const auto cdf = static_cast<double>(reference), survival = static_cast<double>(1 - reference);
      EXPECT_NEAR(kolmogorovCdf(n, d), cdf, 2e-13 * cdf) << n << " " << d;
      EXPECT_NEAR(kolmogorovPValue(n, d), survival, 2e-13) << n << " " << d;
    }
  }
}

TEST(Kolmogorov, tailHasRelativePrecision) {
  // Twice the one-sided tail neglects exp(-6 x²) of it, exp(-24) = 4e-11 at x = 2.
  for (std::size_t n : {5u, 20u, 40u}) {
    for (double x : {2.0001, 2.2, 2.6, 3.5}) {
      const double d = x / std::sqrt(static_cast<double>(n));
      if (d >= 1) continue;
      const auto survival = static_cast<double>(1 - referenceCdf(n, d));
      EXPECT_NEAR(kolmogorovPValue(n, d) / survival, 1, std::exp(-6 * x * x) + 1e-12) << n << " " << d;
    }
  }
}

TEST(Kolmogorov, agreesWithItsClosedForms) {
  for (double n : {1., 2., 3., 10., 100.}) {
    const auto size = static_cast<std::size_t>(n);
    // 1/(2n) ≤ d ≤ 1/n: n! (2d - 1/n)^n.
    for (double t : {0.51, 0.7, 0.999}) {
      const double expected = std::exp(std::lgamma(n + 1) + n * std::log((2 * t - 1) / n));
      EXPECT_NEAR(kolmogorovCdf(size, t / n) / expected, 1, 1e-11) << n << " " << t;
    }
    // d ≥ 1 - 1/n: 1 - 2 (1 - d)^n.
    for (double t : {0.01, 0.5, 0.99}) {
      const double expected = 2 * std::pow(t / n, n);
      if (1 - t / n < 0.5 || expected < 1e-300) continue;
      EXPECT_NEAR(kolmogorovPValue(size, 1 - t / n) / expected, 1, 1e-12) << n << " " << t;
    }
  }
}

TEST(Kolmogorov, methodsMeet) {
  // n = 2000 is evaluated exactly, n = 2001 by the expansion; the law itself moves by 2e-6 at most. Their difference to
  // the law of the other n is estimated from the exact values at 1999 and 2000.
  for (double x : {0.3, 0.5, 0.7, 0.9, 1.2, 1.5, 1.9}) {
    const auto at = [x](std::size_t n) { return kolmogorovCdf(n, x / std::sqrt(static_cast<double>(n))); };
    EXPECT_NEAR(at(2001), 2 * at(2000) - at(1999), 2e-8) << x;
  }
  for (std::size_t n : {50u, 500u, 2000u, 5000u, 1000000u}) {
    const double d = 2 / std::sqrt(static_cast<double>(n));
    EXPECT_NEAR(kolmogorovPValue(n, d * (1 - 1e-12)), kolmogorovPValue(n, d * (1 + 1e-12)), 1e-10) << n;
  }
  // Smirnov's sum for 10^5, an expansion beyond.
  for (double x : {2.01, 3., 5.}) {
    const auto at = [x](std::size_t n) { return kolmogorovPValue(n, x / std::sqrt(static_cast<double>(n))); };
    EXPECT_NEAR(at(100001) / at(100000), 1, 2e-6) << x;
  }
}

TEST(Kolmogorov, tendsToTheLimitingLaw) {
  const std::size_t n = 100000000;
  for (double x : {0.4, 0.8, 1.2, 1.8, 3.0}) {
    double limit = 0;
    for (int k = 1; k < 60; ++k) limit += (k % 2 == 1 ? 2 : -2) * std::exp(-2 * k * k * x * x);
    EXPECT_NEAR(kolmogorovPValue(n, x / 1e4), limit, 1e-4) << x;
  }
}

TEST(Kolmogorov, isMonotoneInD) {
  for (std::size_t n : {1u, 7u, 100u, 3000u, 300000u}) {
    double cdf = 0, survival = 1;
    for (double x = 0; x < 6; x += 0.01) {
      const double d = x / std::sqrt(static_cast<double>(n));
      const double next_cdf = kolmogorovCdf(n, d), next_survival = kolmogorovPValue(n, d);
      // 1e-10: where two methods meet they need not agree in the last digits.
      EXPECT_GE(next_cdf, cdf - 1e-10) << n << " " << d;
      EXPECT_LE(next_survival, survival + 1e-10) << n << " " << d;
      EXPECT_NEAR(next_cdf + next_survival, 1, 1e-15);
      cdf = next_cdf;
      survival = next_survival;
    }
    EXPECT_LT(survival, 1e-20);
  }
}

TEST(Kolmogorov, endsAndBadArguments) {
  EXPECT_EQ(kolmogorovCdf(10, 0), 0);
  EXPECT_EQ(kolmogorovCdf(10, -1), 0);
  EXPECT_EQ(kolmogorovCdf(10, 0.05), 0);
  EXPECT_GT(kolmogorovCdf(10, 0.0501), 0);
  EXPECT_EQ(kolmogorovCdf(10, 1), 1);
  EXPECT_EQ(kolmogorovCdf(10, inf), 1);
  EXPECT_EQ(kolmogorovPValue(10, 0), 1);
  EXPECT_EQ(kolmogorovPValue(10, 1), 0);
  EXPECT_TRUE(std::isnan(kolmogorovCdf(10, nan)));
  EXPECT_TRUE(std::isnan(kolmogorovPValue(10, nan)));
  EXPECT_TRUE(std::isnan(kolmogorovCdf(0, 0.5)));
  EXPECT_TRUE(std::isnan(kolmogorovPValue(0, 0.5)));
  // Tiny probabilities end in zero, not in NaN.
  EXPECT_EQ(kolmogorovCdf(2000, 0.6 / 2000), 0);
  EXPECT_EQ(kolmogorovPValue(100000, 0.3), 0);
  EXPECT_EQ(kolmogorovPValue(100000000, 0.9), 0);
}

TEST(Kolmogorov, isFast) {
  // A hundredfold margin over what a release build takes: no method may turn out to be cubic.
  const auto start = std::chrono::steady_clock::now();
  for (std::size_t n : {100u, 1000u, 2000u, 2001u, 100000u, 1000000u}) {
    for (double x : {0.5, 1., 1.99, 2.5}) kolmogorovPValue(n, x / std::sqrt(static_cast<double>(n)));
  }
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(3));
}

double uniformCdf(double x) { return std::min(1., std::max(0., x)); }

TEST(KsStatistic, isTheLargestGapOnEitherSide) {
  EXPECT_EQ(ksStatistic(std::vector<double>{0.5}, uniformCdf), 0.5);
  EXPECT_EQ(ksStatistic(std::vector<double>{0.25, 0.75}, uniformCdf), 0.25);
  EXPECT_EQ(ksStatistic(std::vector<double>{0.1, 0.2}, uniformCdf), 0.8);
  EXPECT_EQ(ksStatistic(std::vector<double>{0.875, 0.9}, uniformCdf), 0.875);
  EXPECT_EQ(ksStatistic(std::vector<double>{0.5, 0.5, 0.5, 0.5}, uniformCdf), 0.5);
  EXPECT_DOUBLE_EQ(ksStatistic(std::vector<double>{-inf, 0.5, inf}, uniformCdf), 1. / 3);
  EXPECT_TRUE(std::isnan(ksStatistic(std::vector<double>{}, uniformCdf)));
  EXPECT_TRUE(std::isnan(ksStatistic(std::vector<double>{0.5}, [](double) { return nan; })));
}

TEST(KsTest, sortsAndMarksBadSamples) {
  const KsTest test = ksTest(std::vector<double>{0.9, 0.1, 0.4}, uniformCdf);
  EXPECT_EQ(test.n, 3u);
  EXPECT_EQ(test.statistic, ksStatistic(std::vector<double>{0.1, 0.4, 0.9}, uniformCdf));
  EXPECT_EQ(test.p_value, kolmogorovPValue(3, test.statistic));
  EXPECT_TRUE(std::isnan(ksTest(std::vector<double>{}, uniformCdf).p_value));
  EXPECT_TRUE(std::isnan(ksTest(std::vector<double>{0.5, nan, 0.1}, uniformCdf).p_value));
  EXPECT_TRUE(std::isnan(ksTest(std::vector<double>{0.5, nan, 0.1}, uniformCdf).statistic));
}

TEST(KsTest, pValueIsUniformUnderTheLaw) {
  // 4000 samples each; 5 standard errors of a binomial, 12 comparisons: false alarm below 1e-5.
  const int trials = 4000;
  for (std::size_t n : {3u, 20u, 150u}) {
    std::vector<double> p_values;
    for (std::uint64_t trial = 0; trial < trials; ++trial) {
      CounterRng rng(5, trial, static_cast<std::uint32_t>(n));
      std::vector<double> sample(n);
      for (double& x : sample) x = rng.uniform();
      p_values.push_back(ksTest(sample, uniformCdf).p_value);
    }
    for (double level : {0.01, 0.1, 0.5, 0.9}) {
      double below = 0;
      for (double p : p_values) below += p <= level;
      EXPECT_NEAR(below / trials, level, 5 * std::sqrt(level * (1 - level) / trials)) << n;
    }
  }
}

TEST(KsTest, rejectsAWrongLaw) {
  CounterRng rng(6);
  std::vector<double> sample(2000);
  for (double& x : sample) x = std::pow(rng.uniform(), 1.3);
  EXPECT_LT(ksTest(sample, uniformCdf).p_value, 1e-9);
}

}  // namespace
