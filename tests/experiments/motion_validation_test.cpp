// The validation of recursive motion: its scenes, what is judged, and what fails.

#include <experiments/motion_validation.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <cstddef>
#include <utility>
#include <vector>

namespace liestat::experiments {
namespace {

MotionValidation small(std::vector<MotionMethod> methods, std::size_t trials) {
  MotionValidation validation;
  validation.methods = std::move(methods);
  validation.run.trials = trials;
  return validation;
}

TEST(MotionScene, MovesAsItSays) {
  for (const MotionWorld world : all_motion_worlds) {
    MotionScene scene({.world = world, .sigma = 0}, 1, 2);
    for (int k = 0; k < 30; ++k) {
      const std::vector<MotionTrack> before = scene.tracks;
      scene.advance();
      ASSERT_EQ(scene.pairs.size(), scene.options.points);
      const Eigen::Matrix3d R = SO3d::exp(scene.rotation).matrix();
      EXPECT_NEAR(scene.rotation.norm() * 180 / std::numbers::pi, 5, 1e-12);
      const Eigen::Matrix3d F = liestat::detail::skew(scene.translation) * R;
      for (std::size_t i = 0; i < scene.pairs.size(); ++i) {
        // The epipolar constraint of the true motion, exact without noise.
        EXPECT_NEAR(scene.pairs[i].second.homogeneous().dot(F * scene.pairs[i].first.homogeneous()), 0, 1e-14);
        if (world != MotionWorld::plane) {
          EXPECT_EQ(scene.pairs[i].first, before[i].at);
        }
        if (world == MotionWorld::orbit) {
          EXPECT_LE((scene.tracks[i].position - scene.centre).norm(), 0.5 + 1e-12);
        }
      }
    }
  }
  // The same trial twice, and another one.
  MotionScene a({.sigma = 1, .gyroscope_sigma = 0.1}, 3, 4), b(a.options, 3, 4), c(a.options, 3, 5);
  a.advance(), b.advance(), c.advance();
  EXPECT_EQ(a.pairs[7].second, b.pairs[7].second);
  EXPECT_EQ(a.gyroscope.rotation, b.gyroscope.rotation);
  EXPECT_NE(a.pairs[7].second, c.pairs[7].second);
}

TEST(MotionValidation, JudgesWhatIsPromised) {
  const std::vector<MotionRow> rows =
      validateMotion(small({MotionMethod::subspace, MotionMethod::single_start, MotionMethod::gyroscope_bias}, 24));
  EXPECT_EQ(judgementOf(rows).judged(), 11U + 6U);
  for (const MotionRow& row : rows) {
    EXPECT_EQ(row.passed.has_value(), row.promise.has_value());
    EXPECT_TRUE(row.passed.value_or(true)) << name(row.method) << " " << nameOf(row.scene.world) << ": " << row.reason;
    EXPECT_EQ(row.trials, 24U);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_GT(row.median[k], 0);
    if (row.method == MotionMethod::single_start) {
      EXPECT_FALSE(row.promise);
    }
  }
}

TEST(MotionValidation, AWrongNoiseFails) {
  MotionValidation validation = small({MotionMethod::gyroscope_bias}, 40);
  validation.noise_factor = 4;
  const std::vector<MotionRow> rows = validateMotion(validation);
  EXPECT_GE(judgementOf(rows).failed(), 3U);
  for (const MotionRow& row : rows) EXPECT_EQ(row.reason.empty(), row.passed.value_or(true));
}

TEST(MotionValidation, IsTheSameForAnyNumberOfThreads) {
  MotionValidation validation = small({MotionMethod::intervals}, 9);
  validation.run.threads = 1;
  const std::vector<MotionRow> one = validateMotion(validation);
  validation.run.threads = 2;
  const std::vector<MotionRow> two = validateMotion(validation);
  ASSERT_EQ(one.size(), two.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].median, two[i].median);
    EXPECT_EQ(one[i].consistency, two[i].consistency);
  }
}

}  // namespace
}  // namespace liestat::experiments
