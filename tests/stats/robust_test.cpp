// Scores, history, stop rules and thresholds of robust estimation.

#include <stats/random.hpp>
#include <stats/robust.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

namespace {

using namespace liestat;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr std::size_t never = std::numeric_limits<std::size_t>::max();

using Errors = std::vector<double>;

static_assert(BoundedRule<Relevance> && BoundedRule<InlierCount> && BoundedRule<TruncatedCost> &&
              BoundedRule<TrimmedQuantile>);
static_assert(ScoringRule<decltype([](std::span<const double> e) { return static_cast<double>(e.size()); })>);
static_assert(StopRule<NoGainFor> && StopRule<Jump> && StopRule<ScoreReached> && StopRule<DrawsReached>);

TEST(Scores, AreWhatTheyAreDefinedAs) {
  const Errors e{0, 1, 2, 4, 9};
  EXPECT_DOUBLE_EQ(Relevance{4}(e), (1 + 0.5 + 0) / 5) << "the error at T is outside";
  EXPECT_DOUBLE_EQ(Relevance{8}(e), (1 + 0.75 + 0.5 + 0) / 5);
  EXPECT_EQ(InlierCount{4}(e), 3);
  EXPECT_DOUBLE_EQ(TruncatedCost{4}(e), 1 + 0.75 + 0.5);
  EXPECT_EQ(TrimmedQuantile{0.5}(e), -2);
  EXPECT_EQ(TrimmedQuantile{0.6}(e), -2);
  EXPECT_EQ(TrimmedQuantile{0.61}(e), -4);
  EXPECT_EQ(TrimmedQuantile{1}(e), -9);
  EXPECT_EQ(TrimmedQuantile{0}(e), 0) << "at least one";
}

TEST(Scores, TakeErrorsWithoutANumberForOutliers) {
  const Errors with{nan, 1, infinity, 2, nan}, instead{1e9, 1, 1e9, 2, 1e9};
  EXPECT_EQ(Relevance{4}(with), Relevance{4}(instead));
  EXPECT_EQ(InlierCount{4}(with), 2);
  EXPECT_EQ(TruncatedCost{4}(with), TruncatedCost{4}(instead));
  EXPECT_EQ(TrimmedQuantile{0.4}(with), -2);
  EXPECT_EQ(TrimmedQuantile{0.5}(with), -infinity) << "fewer than half have a number";
  for (const double bad : {nan, 0.0, -1.0}) {
    EXPECT_EQ(Relevance{bad}(instead), 0);
    EXPECT_EQ(InlierCount{bad}(instead), 0);
    EXPECT_EQ(TruncatedCost{bad}(instead), 0);
  }
  EXPECT_EQ(Relevance{4}(Errors{}), 0);
  EXPECT_EQ(InlierCount{4}(Errors{}), 0);
  EXPECT_EQ(TruncatedCost{4}(Errors{}), 0);
  EXPECT_EQ(TrimmedQuantile{0.5}(Errors{}), -infinity);
}

/// A hypothesis is better than another only if its contributions reach what is required for that.
template <class Rule>
void boundHolds(const Rule& rule) {
  int better = 0;
  for (std::uint64_t trial = 0; trial < 300; ++trial) {
    CounterRng rng(2, trial);
    Errors a(20), b(20);
    for (double& e : a) e = rng.uniform(0, 10);
    for (double& e : b) e = rng.uniform(0, 12);
    const double best = rule(b);
    double sum = 0;
    for (const double e : a) {
      const double one = rule.contribution(e, best);
      ASSERT_LE(one, 1);
      ASSERT_GE(one, Rule::lowest);
      sum += one;
    }
    if (!(rule(a) > best)) continue;
    ++better;
    EXPECT_GE(sum, rule.required(20, best) - 1e-12);
  }
  EXPECT_GT(better, 100);
  EXPECT_LT(better, 300);
}
TEST(Scores, BoundsHold) {
  boundHolds(Relevance{6});
  boundHolds(InlierCount{6});
  boundHolds(TruncatedCost{6});
  boundHolds(TrimmedQuantile{0.3});
}

TEST(BestHistory, KeepsWhatImproves) {
  BestHistory history;
  EXPECT_TRUE(history.empty());
  history.add(1, nan);
  EXPECT_TRUE(history.empty());
  history.add(2, 0.05);
  history.add(3, 0.05);
  history.add(5, 0.07);
  history.add(8, 0.01);
  history.add(40, 0.5);
  history.add(90, 0.52);
  ASSERT_EQ(history.entries().size(), 4u);
  EXPECT_EQ(history.entries()[2].draw, 40u);
  EXPECT_DOUBLE_EQ(history.gain(0), 0.05);
  EXPECT_DOUBLE_EQ(history.gain(0, -1), 1.05);
  EXPECT_DOUBLE_EQ(history.gain(2), 0.43);
  EXPECT_EQ(history.largestJump(), 2u) << "T_0 of fig. 9";
  EXPECT_EQ(history.largestJump(-1), 0u);
}

TEST(StopRules, SayWhen) {
  BestHistory history;
  EXPECT_FALSE(NoGainFor{10}(history, 9));
  EXPECT_TRUE(NoGainFor{10}(history, 10)) << "nothing was ever found";
  EXPECT_FALSE(Jump{0.3}(history, 100));
  EXPECT_FALSE(ScoreReached{-infinity}(history, 100));
  history.add(2, 0.05);
  history.add(7, 0.2);
  EXPECT_FALSE(NoGainFor{10}(history, 16));
  EXPECT_TRUE(NoGainFor{10}(history, 17));
  EXPECT_FALSE(Jump{0.3}(history, 17));
  EXPECT_FALSE(ScoreReached{0.5}(history, 17));
  history.add(20, 0.6);
  EXPECT_TRUE(Jump{0.3}(history, 20));
  EXPECT_TRUE(ScoreReached{0.5}(history, 20));
  EXPECT_FALSE(ScoreReached{0.7}(history, 20));
  EXPECT_FALSE(DrawsReached{21}(history, 20));
  EXPECT_TRUE(DrawsReached{20}(history, 20));
  const auto any = anyOf(DrawsReached{1000}, NoGainFor{50});
  const auto all = allOf(Jump{0.3}, NoGainFor{50});
  static_assert(StopRule<decltype(anyOf(DrawsReached{1}, Jump{1}))>);
  EXPECT_FALSE(any(history, 69));
  EXPECT_TRUE(any(history, 70));
  EXPECT_FALSE(all(history, 69));
  EXPECT_TRUE(all(history, 70));
  BestHistory first;
  first.add(1, 0.6);
  EXPECT_TRUE(Jump{0.5}(first, 1)) << "the first draw may be the good one";
}

TEST(SampleCount, IsTheSmallestThatIsEnough) {
  EXPECT_EQ(sampleCount(0.5, 2, 0.99), 17u);  // (3/4)^16 = 0.01002
  EXPECT_EQ(sampleCount(0.4, 5, 0.9999), 895u);
  EXPECT_EQ(sampleCount(1, 7, 0.99), 1u);
  EXPECT_EQ(sampleCount(0.5, 2, 0), 0u);
  EXPECT_EQ(sampleCount(0.0, 2, 0.5), never);
  EXPECT_EQ(sampleCount(0.5, 2, 1), never);
  EXPECT_EQ(sampleCount(1e-9, 8, 0.5), never) << "more than can be counted";
  for (const double bad : {nan, -0.5}) {
    EXPECT_EQ(sampleCount(bad, 3, 0.5), never);
    EXPECT_EQ(sampleCount(0.5, 3, nan), never);
  }
  for (const double w : {0.1, 0.35, 0.77}) {
    for (const std::size_t s : {1u, 3u, 7u}) {
      for (const double confidence : {0.5, 0.99, 0.9999}) {
        const double T = static_cast<double>(sampleCount(w, s, confidence)), p = std::pow(w, s);
        EXPECT_GE(-std::expm1(T * std::log1p(-p)), confidence * (1 - 1e-12));
        EXPECT_LT(-std::expm1((T - 1) * std::log1p(-p)), confidence);
      }
    }
  }
  // Distinct measurements: 12 of 24 are inliers, C(12, 7)/C(24, 7) = 1/437 of the samples, not 1/128.
  EXPECT_EQ(sampleCount(std::size_t{12}, std::size_t{24}, std::size_t{7}, 0.5), 303u);
  EXPECT_EQ(sampleCount(0.5, 7, 0.5), 89u);
  EXPECT_EQ(sampleCount(std::size_t{6}, std::size_t{24}, std::size_t{7}, 0.5), never) << "fewer inliers than a sample";
  EXPECT_EQ(sampleCount(std::size_t{0}, std::size_t{0}, std::size_t{1}, 0.5), never);
}

/// Squares of the distances of normal inliers, p equations each, and of outliers uniform on [0, 50].
Errors errorsOf(int inliers, int outliers, std::uint64_t trial, int p = 1) {
  CounterRng rng(5, trial);
  Errors errors;
  for (int i = 0; i < inliers; ++i) {
    double e = 0;
    for (int k = 0; k < p; ++k) e += std::pow(rng.normal(), 2);
    errors.push_back(e);
  }
  for (int i = 0; i < outliers; ++i) errors.push_back(std::pow(rng.uniform(0, 50), 2));
  return errors;
}

TEST(HistogramThreshold, SeparatesTwoEquationsToo) {
  // Distances of χ²_2 rise from zero; the level to fall from is that of the mode.
  int found = 0;
  for (std::uint64_t trial = 0; trial < 50; ++trial) {
    const ErrorThreshold t = histogramThreshold(errorsOf(240, 60, trial, 2), 2 * 9.2103, 9.2103);
    found += t.found;
    EXPECT_GT(t.squared, 4);
    EXPECT_LT(t.squared, 25);
  }
  EXPECT_GE(found, 48);
}

TEST(HistogramThreshold, FallsBack) {
  const auto fallsBack = [](const Errors& errors, double T = 16) {
    const ErrorThreshold t = histogramThreshold(errors, T, 7);
    EXPECT_FALSE(t.found);
    EXPECT_EQ(t.squared, 7);
  };
  fallsBack({});
  fallsBack({nan, nan, infinity, -1});
  fallsBack(Errors(100, 1e6));     // nothing in the histogram
  fallsBack(Errors(100, 0), 0.1);  // a minimum far below any plausible one
  fallsBack(errorsOf(100, 0, 1), nan);
  fallsBack(errorsOf(100, 0, 1), -1);
  fallsBack(errorsOf(100, 0, 1), infinity);
  Errors flat;
  for (int i = 0; i < 800; ++i) flat.push_back(std::pow(0.01 * (i + 0.5), 2));
  fallsBack(flat);
}

TEST(HistogramThreshold, IsSmoothedByHand) {
  // Bins of 0.1: ten errors in each of the first five, two in each of the others. The box of 21 bins, reflected at zero,
  // holds 2·(50 + 6 + 5) of them at zero, less than half of that from bin 13 on, and 42 from bin 15 on, the first saddle.
  // Without the reflection no more than 82 are in it, and 42 is no valley.
  Errors errors;
  for (int bin = 0; bin < 80; ++bin) {
    for (int i = 0; i < (bin < 5 ? 10 : 2); ++i) errors.push_back(std::pow(0.1 * (bin + 0.5), 2));
  }
  const ErrorThreshold t = histogramThreshold(errors, 16, 6.6349);
  EXPECT_TRUE(t.found);
  EXPECT_NEAR(t.squared, 1.55 * 1.55, 1e-12);
}

TEST(HistogramThreshold, FollowsTheUnit) {
  Errors errors = errorsOf(300, 100, 3);
  const double here = histogramThreshold(errors, 16, 6.6349).squared;
  for (double& e : errors) e *= 64;
  EXPECT_DOUBLE_EQ(histogramThreshold(errors, 64 * 16, 64 * 6.6349).squared, 64 * here);
}

/// The polynomial of the moments at T, from its definition.
double polynomial(const Errors& errors, double T) {
  double mu[4] = {};
  for (const double e : errors) {
    for (int n = 0; n < 4; ++n) mu[n] += e < T ? std::pow(std::sqrt(e / T), n) : 0;
  }
  return mu[0] - 12 * mu[1] + 30 * mu[2] - 20 * mu[3];
}

TEST(ScaleFromMoments, IsARootThatKeepsASample) {
  for (std::uint64_t trial = 0; trial < 50; ++trial) {
    const Errors errors = errorsOf(80, 20, trial);
    for (const double significance : {0., 4.}) {
      const MomentScale scale = scaleFromMoments(errors, {.minimal_sample = 7, .significance = significance});
      ASSERT_TRUE(scale.ok());
      EXPECT_NEAR(polynomial(errors, scale.T), 0, 1e-8);
      EXPECT_GE(scale.kept, 7u);
      EXPECT_EQ(static_cast<double>(scale.kept), InlierCount{scale.T}(errors));
      if (significance > 0) continue;
      // It is the smallest: on a fine grid the sign does not change between two errors before it.
      EXPECT_EQ(scale.roots, 1u);
      Errors sorted = errors;
      std::sort(sorted.begin(), sorted.end());
      const double sign = polynomial(errors, sorted[6] * (1 + 1e-9));
      for (double T = sorted[6] * 1.0001; T < std::min(scale.T, sorted[7]) * 0.9999; T *= 1.001) {
        EXPECT_GT(polynomial(errors, T) * sign, 0);
      }
    }
  }
}

TEST(ScaleFromMoments, FindsTheScaleWhateverTheShareOfOutliers) {
  // Quartiles of 200 samples; the median within 10 % of the root in expectation.
  const double half_normal_root = 4.4242;
  for (const int outliers : {0, 60, 150, 240}) {
    std::vector<double> T, first;
    for (std::uint64_t trial = 0; trial < 200; ++trial) {
      const Errors errors = errorsOf(300 - outliers, outliers, trial);
      T.push_back(std::sqrt(scaleFromMoments(errors, {.minimal_sample = 7}).T));
      first.push_back(std::sqrt(scaleFromMoments(errors, {.minimal_sample = 7, .significance = 0}).T));
    }
    std::sort(T.begin(), T.end());
    std::sort(first.begin(), first.end());
    EXPECT_NEAR(T[100], half_normal_root, 0.44) << outliers;
    EXPECT_GT(T[50], 3.3) << outliers;
    EXPECT_LT(T[150], 5.8) << outliers;
    EXPECT_LT(first[100], 0.5) << "the smallest root is chance";
  }
}

TEST(ScaleFromMoments, SaysWhereThereIsNone) {
  const auto none = [](const Errors& errors, std::size_t sample = 1) {
    const MomentScale scale = scaleFromMoments(errors, {.minimal_sample = sample});
    EXPECT_FALSE(scale.ok());
    EXPECT_TRUE(std::isnan(scale.T));
    EXPECT_EQ(scale.kept, 0u);
  };
  none({});
  none({nan, -1, infinity});
  none(Errors(10, 0));
  none({1, 2, 3}, 4);
  const MomentScale same = scaleFromMoments(Errors(100, 1.0));
  EXPECT_TRUE(same.ok()) << "100 equal errors have the root 1 - 12 u + 30 u² - 20 u³ = 0";
  EXPECT_NEAR(polynomial(Errors(100, 1.0), same.T), 0, 1e-8);
}

TEST(ScaleFromMoments, FollowsTheUnit) {
  Errors errors = errorsOf(300, 100, 3);
  const MomentScale here = scaleFromMoments(errors, {.minimal_sample = 5});
  for (const double unit : {0x1p-400, 0x1p300}) {
    Errors scaled = errors;
    for (double& e : scaled) e *= unit;
    const MomentScale there = scaleFromMoments(scaled, {.minimal_sample = 5});
    EXPECT_EQ(there.kept, here.kept);
    EXPECT_NEAR(there.T / unit / here.T, 1, 1e-12);
  }
}

// Noise of twice the stated deviation moves inliers beyond the threshold; at right noise a thousandth is refuted.
TEST(CheckNoise, SeesNoiseThatIsLargerThanStated) {
  constexpr double threshold = 6.6349;
  const int trials = 1000;
  for (const int outliers : {0, 40, 100}) {
    int alarms = 0, seen = 0;
    std::vector<double> scales;
    for (int t = 0; t < trials; ++t) {
      Errors errors = errorsOf(200 - outliers, outliers, static_cast<std::uint64_t>(t) + 700);
      alarms += checkNoise(errors, threshold).refuted();
      for (double& e : errors) e *= 4;  // in units of half the noise
      const NoiseCheck half = checkNoise(errors, threshold);
      seen += half.refuted();
      scales.push_back(half.scale);
    }
    std::sort(scales.begin(), scales.end());
    EXPECT_LE(alarms, 0.001 * trials + 4 * std::sqrt(0.001 * trials)) << outliers;
    EXPECT_GE(seen, 0.99 * trials) << outliers;
    EXPECT_NEAR(scales[trials / 2], 2, 0.3) << outliers;
  }
  const NoiseCheck none = checkNoise(Errors{nan, 100, infinity}, threshold);
  EXPECT_FALSE(none.tested() || none.refuted());
  EXPECT_STREQ(none.word(), "untested");
}

// Inliers and outliers of two equations, as dense in the plane.
TEST(CheckNoise, KnowsTheNumberOfEquations) {
  constexpr double threshold = 9.2103;
  const int trials = 1000;
  int alarms = 0, seen = 0;
  for (int t = 0; t < trials; ++t) {
    CounterRng rng(31, static_cast<std::uint64_t>(t));
    Errors errors, half;
    for (int i = 0; i < 150; ++i) {
      const bool inlier = i < 100;
      const double x = inlier ? rng.normal() : rng.uniform(-25, 25), y = inlier ? rng.normal() : rng.uniform(-25, 25);
      errors.push_back(x * x + y * y);
      half.push_back(4 * errors.back());
    }
    alarms += checkNoise(errors, threshold, 2).refuted();
    seen += checkNoise(half, threshold, 2).refuted();
    EXPECT_TRUE(std::isnan(checkNoise(half, threshold, 2).scale)) << "that of one equation";
  }
  EXPECT_LE(alarms, 0.001 * trials + 4 * std::sqrt(0.001 * trials));
  EXPECT_GE(seen, 0.99 * trials);
}

}  // namespace
