// Consensus over features: drifting tracks are found and left out, and what remains is as good as without them.

#include <fusion/init/closed_form.hpp>
#include <fusion/init/consensus.hpp>
#include <support/vi_measurements.hpp>
#include <support/vi_scene.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <random>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

constexpr double pixel = 1. / 450;
const InitialisationOptions options{.bearing_noise = pixel, .closed_form = {.singular_values = false}};

/// The options with a seed.
InitialisationOptions drawnFrom(std::uint64_t seed) {
  InitialisationOptions o = options;
  o.consensus.seed = seed;
  return o;
}

Scene noisyScene(const SceneOptions& scene_options, std::uint64_t seed) {
  Scene scene(scene_options, seed);
  CounterRng random(seed, 0, 1);
  measure(scene, {1.7e-4, 2e-3}, random);
  scene.addNoise(pixel, random);
  return scene;
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

TEST(ClosedFormRansac, LeavesOutDriftingTracks) {
  struct Row {
    std::size_t wrong;
    double pixels;  ///< a step of the walk
  };
  constexpr std::size_t features = 40, trials = 200;
  for (const auto& [wrong, pixels] : {Row{16, 8}, Row{20, 8}, Row{16, 2}}) {
    std::size_t kept_right = 0, kept_wrong = 0, right = 0, ok = 0, hypotheses = 0;
    std::vector<double> robust_error, oracle_error, plain_error;
    for (std::size_t trial = 0; trial < trials; ++trial) {
      Scene scene = noisyScene({.images = 21, .features = features}, 120000 + trial);
      CounterRng random(120000 + trial, 0, 2);
      scene.addDrift(wrong, pixels * pixel, random);
      const auto robust = solveClosedFormRobustly(scene.window, drawnFrom(trial));
      hypotheses += robust.hypotheses;
      ok += robust.ok();
      for (const std::size_t i : robust.inliers) ++(i < wrong ? kept_wrong : kept_right);
      right += features - wrong;
      EXPECT_EQ(robust.inliers.size() + robust.outliers.size(), features);
      ASSERT_FALSE(robust.result.solutions.empty());
      robust_error.push_back((robust.result.solutions[0].velocity - scene.velocity).norm());

      const auto plain = solveClosedForm(scene.window, options);
      const bool none = plain.solutions.empty();
      plain_error.push_back(none ? 10 : (plain.solutions[0].velocity - scene.velocity).norm());
      for (std::size_t i = 0; i < wrong; ++i) scene.window.features[i].clear();
      const auto oracle = solveClosedForm(scene.window, options);
      oracle_error.push_back((oracle.solutions.at(0).velocity - scene.velocity).norm());
    }
    const double precision = static_cast<double>(kept_right) / static_cast<double>(kept_right + kept_wrong);
    const double recall = static_cast<double>(kept_right) / static_cast<double>(right);
    std::printf(
        "  %zu of %zu drift by %.0f px: precision %.4f, recall %.4f, ok %zu of %zu, %.0f hypotheses; speed error "
        "%.4f, oracle %.4f, without selection %.2f m/s\n",
        wrong, features, pixels, precision, recall, ok, trials,
        static_cast<double>(hypotheses) / static_cast<double>(trials), median(robust_error), median(oracle_error),
        median(plain_error));
    EXPECT_GE(precision, 0.995);
    EXPECT_GE(recall, 0.99);
    EXPECT_GE(ok, trials * 98 / 100);
    // The same windows: what differs is the few features that were lost.
    EXPECT_LE(median(robust_error), 1.05 * median(oracle_error));
    EXPECT_GE(median(plain_error), 5 * median(robust_error));
  }
}

TEST(ClosedFormRansac, TakesAllWhereAllAreRight) {
  std::size_t kept = 0, all = 0, hypotheses = 0;
  for (std::size_t trial = 0; trial < 100; ++trial) {
    const Scene scene = noisyScene({.images = 11, .features = 20, .window = 1}, 140000 + trial);
    const auto robust = solveClosedFormRobustly(scene.window, drawnFrom(trial));
    kept += robust.inliers.size();
    all += 20;
    hypotheses += robust.hypotheses;
  }
  std::printf("  all right, one second: recall %.4f, %.1f hypotheses\n",
              static_cast<double>(kept) / static_cast<double>(all), static_cast<double>(hypotheses) / 100);
  EXPECT_GE(kept, all * 99 / 100);
}

TEST(ClosedFormRansac, IsTheGeneratorsAndNobodyElses) {
  Scene scene = noisyScene({.images = 21, .features = 40}, 5);
  CounterRng random(5, 0, 2);
  scene.addDrift(16, 8 * pixel, random);
  const auto solve = [&](std::uint64_t seed) { return solveClosedFormRobustly(scene.window, drawnFrom(seed)); };
  const auto first = solve(3), again = solve(3), other = solve(4);
  EXPECT_EQ(first.inliers, again.inliers);
  EXPECT_EQ(first.hypotheses, again.hypotheses);
  EXPECT_EQ(first.result.solutions.at(0).velocity, again.result.solutions.at(0).velocity);
  // The consensus does not depend on the seed.
  EXPECT_EQ(first.inliers, other.inliers);
  for (const std::size_t i : first.inliers) EXPECT_TRUE(first.result.features[i].used);
  for (const std::size_t i : first.outliers) {
    EXPECT_FALSE(first.result.features[i].used);
    EXPECT_EQ(first.result.features[i].observations, 21u);
  }
}

TEST(ClosedFormRansac, SaysWhenThereIsNoConsensus) {
  Scene scene = noisyScene({.images = 21, .features = 20}, 8);
  CounterRng random(8, 0, 2);
  scene.addDrift(20, 0.05, random);
  const auto robust = solveClosedFormRobustly(scene.window, options);
  EXPECT_TRUE(robust.inliers.empty());
  EXPECT_EQ(robust.hypotheses, options.consensus.max_hypotheses);
  EXPECT_FALSE(robust.ok());
}

TEST(ClosedFormRansac, RefusesBadInput) {
  Scene scene = noisyScene({.images = 6, .features = 8}, 1);
  const auto fault = [&](const ClosedFormWindow& window, const InitialisationOptions& o) {
    return solveClosedFormRobustly(window, o).result.fault;
  };
  EXPECT_EQ(fault(scene.window, {}), FaultKind::bad_option);
  InitialisationOptions bad = options;
  bad.consensus.features_drawn = 0;
  EXPECT_EQ(fault(scene.window, bad), FaultKind::bad_option);
  bad = options;
  bad.consensus.confidence = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(fault(scene.window, bad), FaultKind::bad_option);
  bad = options;
  bad.consensus.misfit_sigmas = 0;
  EXPECT_EQ(fault(scene.window, bad), FaultKind::bad_option);
  ClosedFormWindow window = scene.window;
  window.features[2][1].bearing.setZero();
  EXPECT_EQ(fault(window, options), FaultKind::bad_bearing);
  window.features.assign(3, {});
  EXPECT_EQ(fault(window, options), FaultKind::no_feature);
  // Too few to choose from: all are taken.
  window = scene.window;
  window.features.resize(4);
  const auto few = solveClosedFormRobustly(window, options);
  EXPECT_EQ(few.hypotheses, 0u);
  EXPECT_EQ(few.inliers.size(), 4u);
  EXPECT_EQ(few.result.fault, FaultKind::none);
}

}  // namespace
