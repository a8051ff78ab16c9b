// The choice between two models: quantiles, tests of support and fit, criteria.

#include <stats/model_choice.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace {

using namespace liestat;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

TEST(ModelChoice, BinomialQuantileIsThatOfTheSums) {
  for (const std::size_t n : {std::size_t(1), std::size_t(7), std::size_t(60), std::size_t(1000)}) {
    for (const double share : {1e-6, 0.01, 0.3, 0.9}) {
      for (const double probability : {0.01, 0.5, 0.95, 0.999}) {
        // Direct sums of the probabilities.
        double sum = 0, log_term = static_cast<double>(n) * std::log1p(-share);
        std::size_t k = 0;
        for (;; ++k) {
          sum += std::exp(log_term);
          if (sum >= probability || k == n) break;
          log_term += std::log(static_cast<double>(n - k) / static_cast<double>(k + 1) * share / (1 - share));
        }
        EXPECT_EQ(binomialQuantile(probability, n, share), k) << n << " " << share << " " << probability;
      }
    }
  }
  EXPECT_EQ(binomialQuantile(0.999, 0, 0.5), 0u);
  EXPECT_EQ(binomialQuantile(0.999, 10, 0), 0u);
  EXPECT_EQ(binomialQuantile(0.999, 10, 1), 10u);
  EXPECT_EQ(binomialQuantile(0.999, 10, nan), 0u);
}

TEST(ModelChoice, SupportCountsFreedomAndChance) {
  const SupportTest test;
  // Without chance, what the free parameters more explain by themselves, rounded up.
  EXPECT_EQ(test.explained(50, 3, 2, 0), 2u);
  EXPECT_EQ(test.explained(50, 5, 2, 0), 3u);
  EXPECT_EQ(test.explained(50, -3, 1, 0), 0u);
  EXPECT_EQ(test.explained(50, 1, 1, 0.1), 1 + binomialQuantile(0.999, 50, 0.1));
}

TEST(ModelChoice, PoissonsBinomialLawIsTheBinomialOneWhereChancesAreEqual) {
  for (const std::size_t n : {0u, 1u, 7u, 60u}) {
    for (const double q : {0.0, 0.02, 0.3, 1.0}) {
      const std::vector<double> chances(n, q);
      EXPECT_EQ(poissonBinomialQuantile(0.999, chances), binomialQuantile(0.999, n, q)) << n << " " << q;
    }
  }
  // Two certain ones and a coin.
  EXPECT_EQ(poissonBinomialQuantile(0.4, std::vector<double>{1, 0.5, 1}), 2u);
  EXPECT_EQ(poissonBinomialQuantile(0.9, std::vector<double>{1, 0.5, 1}), 3u);
}

TEST(ModelChoice, IsotropicNoiseLeavesABetaLaw) {
  // e'/e of two equations of which one is free: 2/π asin √x, as by the beta function.
  for (const double x : {0.001, 0.1, 0.5, 0.99}) {
    EXPECT_NEAR(chanceOfIsotropicNoise(1 / x, 1, 1, 2), detail::incompleteBeta(0.5, 0.5, x), 1e-12);
  }
  EXPECT_EQ(chanceOfIsotropicNoise(0.5, 1, 1, 2), 1);
  EXPECT_NEAR(chanceOfIsotropicNoise(4, 1, 1, 3), 0.5, 1e-12);  // the height of a point of a sphere is uniform
}

TEST(ModelChoice, ExcessNoiseIsFoundBesideABackgroundOfChance) {
  // 200 errors of s² χ²_p and 50 of random measurements. The mean over 40 trials has a standard error of 2 to 3 %.
  for (const int p : {1, 2}) {
    for (const double s2 : {0.5, 1.0, 4.0}) {
      const double threshold = p == 1 ? 6.635 : 9.21, reach = 400 * threshold;
      double sum = 0;
      constexpr int trials = 40;
      for (std::uint64_t seed = 0; seed < trials; ++seed) {
        CounterRng random(seed, static_cast<std::uint64_t>(p), 0);
        std::vector<SquaredError> errors;
        for (int i = 0; i < 250; ++i) {
          double e = 0;
          for (int k = 0; k < p; ++k) e += std::pow(random.normal(), 2);
          const double chance = random.uniform();
          errors.push_back({i < 200 ? s2 * e : reach * std::pow(chance, 2.0 / p), threshold, p});
        }
        sum += excessNoise(errors, 0, std::pow(9 * threshold / reach, 0.5 * p));
      }
      EXPECT_NEAR(sum / trials, s2, 0.12 * s2) << p;
    }
  }
  EXPECT_EQ(excessNoise({}, 0, 0.1), max_excess_noise);
  EXPECT_EQ(excessNoise(std::vector<SquaredError>(5, {1, 6.6, 1}), 5, 0.1), max_excess_noise) << "nothing is left";
}

TEST(ModelChoice, TheCostOfARightModelIsWithinItsDeviations) {
  // e - e' of χ²₁: the excess has mean 0 and deviation 1; 400 trials, four standard errors.
  double sum = 0, squares = 0;
  constexpr int trials = 400;
  for (std::uint64_t seed = 0; seed < trials; ++seed) {
    CounterRng random(seed, 0, 0);
    double cost = 0;
    for (int i = 0; i < 100; ++i) cost += std::min(std::pow(random.normal(), 2), CostTest::most(1));
    const double z = CostTest::excess(cost, 100, 1, 0, 1);
    sum += z, squares += z * z;
  }
  EXPECT_NEAR(sum / trials, 0, 4 / std::sqrt(trials));
  EXPECT_NEAR(squares / trials, 1, 4 * std::sqrt(2.0 / trials));
}

TEST(ModelChoice, FitNeedsDegreesOfFreedom) {
  const ExponentialPhi phi;
  // As many parameters as equations: nothing to compare.
  EXPECT_FALSE(fitRejects({100, 3, 0}, {0, 3, 3}, phi));
  // Not nested.
  EXPECT_FALSE(fitRejects({100, 50, 2}, {1, 50, 2}, phi));
  EXPECT_FALSE(fitRejects({nan, 50, 1}, {1, 50, 2}, phi));
  EXPECT_TRUE(fitRejects({100, 50, 1}, {1, 50, 2}, phi));
  EXPECT_FALSE(fitRejects({50, 50, 1}, {48, 50, 2}, phi));
  EXPECT_DOUBLE_EQ((ModelFit{90, 100, 10}.normalised()), 1);
}

TEST(ModelChoice, PhiIsPerDegreeOfFreedomOfTheSpecificModel) {
  EXPECT_DOUBLE_EQ(ExponentialPhi{2}(4, 3), std::exp(-2.0 / 4));
  EXPECT_DOUBLE_EQ(ExponentialPhi{3}(10, 4), std::exp(-3 * 6.0 / 10));
  // So is the κ that is fitted: it decides between two labels of one improvement where Φ does.
  const ModelFit specific{20, 12, 2}, general{6, 12, 6};
  const LabelledPair pair{specific, general, true};
  const double kappa = 2 * fitKappa({&pair, 1});  // the middle of [0, κ]
  EXPECT_TRUE(fitRejects(specific, general, ExponentialPhi{(1 - 1e-9) * kappa}));
  EXPECT_FALSE(fitRejects(specific, general, ExponentialPhi{(1 + 1e-9) * kappa}));
}

TEST(TailProbabilities, AreThoseOfTheClosedForms) {
  constexpr double eps = 1e-13;  // that of the continued fraction
  const double pi = std::acos(-1.0);
  for (const double x : {0.01, 0.7, 3.0, 11.0, 40.0}) {
    // χ²: Q(x, n + 2) = Q(x, n) + (x/2)^(n/2) exp(-x/2)/Γ(n/2 + 1), Γ(3/2) = √π/2, Γ(5/2) = 3√π/4.
    const double half = x / 2, e = std::exp(-half);
    const double one = std::erfc(std::sqrt(half)), three = one + 2 * std::sqrt(half / pi) * e;
    EXPECT_NEAR(detail::chiSquaredTail(x, 1), one, eps * one);
    EXPECT_NEAR(detail::chiSquaredTail(x, 3), three, eps * three);
    const double five = three + 4 * std::pow(half, 1.5) * e / (3 * std::sqrt(pi));
    EXPECT_NEAR(detail::chiSquaredTail(x, 5), five, eps * five);
    EXPECT_NEAR(detail::chiSquaredTail(x, 2), e, eps * e);
    EXPECT_NEAR(detail::chiSquaredTail(x, 6), e * (1 + half + half * half / 2), eps);
    // Student's law of one (Cauchy's) and of two degrees of freedom, either side of zero.
    for (const double t : {x, -x}) {
      EXPECT_NEAR(detail::studentTail(t, 1), 0.5 - std::atan(t) / pi, eps);
      EXPECT_NEAR(detail::studentTail(t, 2), 0.5 - t / (2 * std::sqrt(2 + t * t)), eps);
    }
    // Hotelling's of two dimensions; of one it is Student's t².
    EXPECT_NEAR(detail::hotellingTail(x, 2, 9), std::pow(1 + x / 8, -3.5), eps);
    EXPECT_NEAR(detail::hotellingTail(x, 1, 9), 2 * detail::studentTail(std::sqrt(x), 8), eps);
  }
}

TEST(ModelChoice, KappaIsFittedToLabels) {
  // Right specific models, and general ones that improve the fit by a factor of four.
  std::vector<LabelledPair> pairs;
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    CounterRng rng(seed, 3);
    LabelledPair pair;
    pair.general_is_right = seed % 2 == 1;
    double general = 0, extra = 0;
    for (int k = 0; k < 95; ++k) general += std::pow(rng.normal(), 2);
    for (int k = 0; k < 3; ++k) extra += std::pow(rng.normal() + (pair.general_is_right ? 7 : 0), 2);
    pair.specific = {general + extra, 100, 2}, pair.general = {general, 100, 5};
    pairs.push_back(pair);
  }
  const double kappa = fitKappa(pairs);
  EXPECT_GT(kappa, 3);
  EXPECT_LT(kappa, 60);
  int wrong = 0;
  for (const LabelledPair& pair : pairs) {
    wrong += fitRejects(pair.specific, pair.general, ExponentialPhi{kappa}) != pair.general_is_right;
  }
  EXPECT_EQ(wrong, 0);
  // No other κ decides more of them, where labels contradict each other.
  for (std::size_t k = 0; k < pairs.size(); k += 9) pairs[k].general_is_right = !pairs[k].general_is_right;
  const auto right = [&](double value) {
    int sum = 0;
    for (const LabelledPair& pair : pairs) {
      sum += fitRejects(pair.specific, pair.general, ExponentialPhi{value}) == pair.general_is_right;
    }
    return sum;
  };
  const int reached = right(fitKappa(pairs));
  for (double value = 0.05; value < 100; value += 0.1) EXPECT_LE(right(value), reached) << value;
  EXPECT_TRUE(std::isnan(fitKappa({})));
}

TEST(ModelChoice, CriteriaByHand) {
  const std::vector<double> errors = {0.5, 3, 100, nan};
  // Matches (4 numbers) under a homography (2 equations, 8 parameters).
  const CriterionInput model{errors, 4, 2, 8};
  EXPECT_EQ(model.structureDimension(), 2);
  const double lambda = -2 * std::log(0.001);
  EXPECT_NEAR(informationCriterion(model, 9, 0.001), 3.5 + 2 * 2 * lambda + 2 * (9 + 4 * lambda) + 8 * lambda, 1e-9);
  EXPECT_NEAR(gric(model), 3.5 + 2 * 4 + std::log(4.) * 2 * 4 + std::log(16.) * 8, 1e-12);
  EXPECT_NEAR(geometricAic(model, 9), 3.5 + 2 * 9 + 2 * (2 * 4 + 8), 1e-12);
}

}  // namespace
