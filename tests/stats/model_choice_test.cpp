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
