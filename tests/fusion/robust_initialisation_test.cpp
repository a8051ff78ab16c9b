// The whole initialisation with wrong tracks and an unknown bias of the gyroscope: as good as with the right tracks
// given, at any bias.

#include <fusion/imu/window.hpp>
#include <fusion/init/gyroscope_bias.hpp>
#include <fusion/init/robust_initialisation.hpp>
#include <support/vi_recorded.hpp>

#include <Eigen/Cholesky>
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
using Status = FusionStatus;

constexpr double pixel = 1. / 450;
constexpr ImuNoise<double> adis{1.7e-4, 2e-3};
const InitialisationOptions options{.bearing_noise = pixel, .closed_form = {.singular_values = false}};

RobustInitialisation initialise(const RecordedScene& recorded, std::uint64_t seed,
                                double accelerometer_sigma = options.prior.accelerometer_sigma) {
  InitialisationOptions drawn = options;
  drawn.consensus.seed = seed;
  drawn.prior.accelerometer_sigma = accelerometer_sigma;
  return initialiseRobustly(recorded.window, drawn);
}
double speedError(const ClosedFormResult& result, const Scene& scene) {
  return result.solutions.empty() ? 10 : (result.solutions[0].velocity - scene.velocity).norm();
}

TEST(RobustInitialisation, IsAsGoodAsWithTheRightTracks) {
  struct Row {
    double bias, window;
    std::size_t drifting;
  };
  constexpr std::size_t features = 40, trials = 40;
  std::vector<double> without_bias;
  for (const auto& [bias, window, drifting] :
       {Row{0, 2, 16}, Row{0.05, 2, 16}, Row{0.1, 2, 16}, Row{0.2, 2, 20}, Row{0.1, 1, 16}}) {
    std::vector<double> error, speed, oracle;
    double nees = 0;
    std::size_t ok = 0, right = 0, wrong = 0, hypotheses = 0;
    for (std::size_t trial = 0; trial < trials; ++trial) {
      const RecordedScene recorded(
          {.scene = {.images = static_cast<std::size_t>(10 * window) + 1, .features = features, .window = window},
           .bias = bias,
           .noise = adis,
           .drifting = drifting},
          240000 + trial);
      const auto found = initialise(recorded, trial);
      ok += found.ok();
      hypotheses += found.hypotheses;
      EXPECT_EQ(found.inliers.size() + found.outliers.size(), features);
      for (const std::size_t i : found.inliers) ++(i < drifting ? wrong : right);
      const Eigen::Vector3d off = found.gyroscope_bias - recorded.bias;
      error.push_back(off.norm());
      nees += off.dot(found.bias_covariance.llt().solve(off)) / trials;
      speed.push_back(speedError(found.result, recorded.scene));
      // The same with the right tracks, and a prior around the true bias.
      InertialWindow kept = recorded.window;
      for (std::size_t i = 0; i < drifting; ++i) kept.features[i].clear();
      InitialisationOptions told = options;
      told.gyroscope_bias.start = recorded.bias;
      told.gyroscope_bias.min_window = 0;
      oracle.push_back(speedError(estimateGyroscopeBias(kept, told).result, recorded.scene));
    }
    const double precision = static_cast<double>(right) / static_cast<double>(right + wrong);
    const double recall = static_cast<double>(right) / static_cast<double>(trials * (features - drifting));
    std::printf(
        "  %.2f rad/s, %.0f s, %zu of %zu drift: ok %zu of %zu, precision %.4f, recall %.4f, bias %.5f / %.5f "
        "rad/s, NEES %.2f; speed error %.4f / %.3f, right tracks given %.4f / %.3f m/s; %.0f hypotheses\n",
        bias, window, drifting, features, ok, trials, precision, recall, quantileOf(error, 0.5),
        quantileOf(error, 0.95), nees, quantileOf(speed, 0.5), quantileOf(speed, 0.95), quantileOf(oracle, 0.5),
        quantileOf(oracle, 0.95), static_cast<double>(hypotheses) / static_cast<double>(trials));
    EXPECT_GE(precision, 0.999);
    EXPECT_GE(recall, 0.998);
    EXPECT_GE(ok, trials - 1);
    EXPECT_LE(quantileOf(speed, 0.5), 1.05 * quantileOf(oracle, 0.5));
    EXPECT_LE(quantileOf(speed, 0.95), 1.1 * quantileOf(oracle, 0.95));
    EXPECT_LE(quantileOf(error, 0.5), window < 2 ? 0.005 : 0.0017);
    // The share of the image noise is 3; the gyroscope's adds a tenth.
    EXPECT_NEAR(nees, 3.2, 4 * std::sqrt(6. / trials));
  }
}

// There is no motion to agree on, but the tracks that stay and the bias are found by their rotation.
TEST(RobustInitialisation, AtRestAndAtConstantVelocity) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    RecordedOptions recorded_options{.scene = {.images = 21, .features = 30, .motion = SceneMotion::stationary},
                                     .bias = 0.1,
                                     .noise = adis,
                                     .drifting = 12};
    const RecordedScene still(recorded_options, seed);
    // The accelerometer has no bias, and the prior says so: else gravity is known to the bias over 9.81 m/s².
    const auto rest = initialise(still, seed, 0.02);
    EXPECT_EQ(rest.status, Status::bias_from_rotations);
    EXPECT_EQ(rest.epipolar.status, FusionStatus::ok);
    EXPECT_TRUE(rest.epipolar.without_parallax);
    EXPECT_EQ(rest.result.status, FusionStatus::stationary);
    EXPECT_FALSE(rest.ok());
    EXPECT_EQ(rest.inliers.size(), 18u);
    EXPECT_EQ(rest.result.features[0].observations, 21u);
    EXPECT_LE((rest.gyroscope_bias - still.bias).norm(), 0.003);
    ASSERT_EQ(rest.result.solutions.size(), 1u);
    const Eigen::Vector3d G = rest.result.solutions[0].gravity;
    EXPECT_LE(G.cross(still.scene.gravity).norm() / (9.81 * 9.81), 0.003);
    const Eigen::Vector3d vague = initialise(still, seed).result.solutions.at(0).gravity;
    EXPECT_LE(vague.cross(still.scene.gravity).norm() / (9.81 * 9.81), 3 * options.prior.accelerometer_sigma / 9.81);

    recorded_options.scene.motion = SceneMotion::constant_velocity;
    const RecordedScene uniform(recorded_options, seed);
    const auto moved = initialise(uniform, seed);
    EXPECT_FALSE(moved.ok());
    EXPECT_LE((moved.gyroscope_bias - uniform.bias).norm(), 0.02);
  }
}

// A body at rest is called so whatever its accelerometer's bias is, with noise of pixels that is not what was said, and
// with wild tracks; its gravity has the tilt that the bias can hide.
TEST(RobustInitialisation, RestIsRest) {
  struct Row {
    double accelerometer, sigma;
    std::size_t drifting;
  };
  int stationary = 0, all = 0;
  for (const Row& row :
       {Row{0, 1, 0}, Row{0.02, 1, 0}, Row{0.1, 1, 0}, Row{0.05, 0.7, 0}, Row{0.05, 1.3, 0}, Row{0.05, 1, 6}}) {
    for (std::uint64_t seed = 0; seed < 12; ++seed) {
      CounterRng random(seed, 7);
      RecordedOptions how{.scene = {.images = 21, .features = 20, .motion = SceneMotion::stationary},
                          .bias = 0.02,
                          .sigma = row.sigma * pixel,
                          .noise = adis,
                          .drifting = row.drifting};
      how.scene.bias = row.accelerometer * random.unitVector<3>();
      if (seed % 2 == 0) how.scene.turn = SceneTurn::none;
      const RecordedScene still(how, 900 + seed);
      const auto found = initialise(still, seed);
      ++all;
      if (found.result.status != Status::stationary) continue;
      ++stationary;
      ASSERT_TRUE(found.rest);
      EXPECT_TRUE(found.result.consistent);
      const RefinementResult& rest = *found.rest;
      EXPECT_LE(rest.velocity().norm(), 1e-6);
      const Eigen::Vector3d G = still.scene.gravity;
      const double tilt = std::atan2(rest.gravity.cross(G).norm(), rest.gravity.dot(G));
      EXPECT_LE(tilt, 5 * rest.tilt_sigma);
      // The prior of the accelerometer's bias where turns do not tell it.
      if (seed % 2 == 0) {
        const double by_prior = options.prior.accelerometer_sigma / 9.81;
        EXPECT_NEAR(rest.tilt_sigma, by_prior, 0.05 * by_prior);
      }
      EXPECT_LE((rest.bias.gyroscope - still.bias).norm(), 0.002);
      EXPECT_GT(found.result.unseen_speed_per_depth, 0.002);
      EXPECT_LT(found.result.unseen_speed_per_depth, 0.1);
    }
  }
  // Five in a thousand are not, and one by its readings.
  std::printf("  %d of %d at rest were called so\n", stationary, all);
  EXPECT_GE(stationary, all - 4);
}

// Uniform motion is rest to an inertial sensor: what is called stationary is slower, for the distance of its features,
// than the result says would have been seen, and hardly anything is that moves as fast as it excludes.
TEST(RobustInitialisation, SlowMotionIsNotRest) {
  int excluded = 0, called = 0;
  for (const double far : {4., 20., 80.}) {  // 1 m/s: 0.25, 0.05 and 0.0125 m/s among features 2 to 8 m away
    for (const double seconds : {1., 2., 4.}) {
      int stationary = 0;
      constexpr int trials = 10;
      for (std::uint64_t seed = 0; seed < trials; ++seed) {
        const RecordedScene slow({.scene = {.images = static_cast<std::size_t>(10 * seconds) + 1,
                                            .features = 20,
                                            .motion = SceneMotion::constant_velocity,
                                            .turn = SceneTurn::none,
                                            .window = seconds,
                                            .far = far},
                                  .bias = 0.01,
                                  .noise = adis},
                                 1000 + seed);
        const auto found = initialise(slow, seed);
        EXPECT_FALSE(found.ok());
        if (found.result.status != Status::stationary) continue;
        ++stationary;
        // The features' mean inverse distance: 1 m/s is that for each metre.
        double inverse = 0;
        for (const Eigen::Vector3d& P : slow.scene.features) inverse += 1 / (20 * P.norm());
        ++called;
        excluded += inverse > found.result.unseen_speed_per_depth;
      }
      std::printf("  1 m/s, %3.0f to %3.0f m, %.0f s: %d of %d stationary\n", 2 * far, 8 * far, seconds, stationary,
                  trials);
      if (far < 10 || (far < 30 && seconds > 1)) {
        EXPECT_EQ(stationary, 0);
      }
    }
  }
  // At most one of the few stationary verdicts is on a motion faster than it excludes.
  EXPECT_GT(called, 0);
  EXPECT_LE(excluded, 1);
}

// Tracks without parallax and readings that vary by less than a hundredth of gravity are not rest.
TEST(RobustInitialisation, UnsteadyReadingsAreNotRest) {
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    RecordedScene shaken(
        {.scene = {.images = 21, .features = 20, .motion = SceneMotion::stationary, .turn = SceneTurn::none},
         .bias = 0.01,
         .noise = adis},
        1100 + seed);
    EXPECT_EQ(initialise(shaken, seed).result.status, Status::stationary);
    // An oscillation of 0.05 m/s² at 1 Hz: 1.3 mm.
    for (ImuSample<double>& reading : shaken.readings) {
      reading.specific_force.x() += 0.05 * std::sin(6.283185307179586 * reading.time);
    }
    shaken.window = windowOf(shaken.scene, shaken.readings, {.preintegration = {.noise = adis}});
    const auto found = initialise(shaken, seed);
    EXPECT_EQ(found.result.status, Status::no_parallax);
    EXPECT_FALSE(found.rest);
    EXPECT_TRUE(found.result.solutions.empty());
  }
}

// Tracks on a body that moves uniformly are as good an answer as the world's, and nothing in the data says which is
// which: both come, the larger group first.
TEST(RobustInitialisation, ASecondMotionIsAmbiguous) {
  constexpr std::size_t features = 40;
  for (const std::size_t on_object : {12, 16, 20, 24}) {
    int ambiguous = 0, ok = 0;
    constexpr int trials = 10;
    for (std::uint64_t seed = 0; seed < trials; ++seed) {
      const RecordedScene recorded(
          {.scene = {.images = 21, .features = features, .on_object = on_object}, .bias = 0.02, .noise = adis},
          1200 + seed);
      const auto found = initialise(recorded, seed);
      ok += found.ok();
      if (found.status != Status::ambiguous) continue;
      ++ambiguous;
      ASSERT_TRUE(found.second);
      EXPECT_GE(found.inliers.size(), found.second->inliers.size());
      // Each group is of one body, and its velocity is the camera's past that body.
      const auto check = [&](const ClosedFormResult& result, const std::vector<std::size_t>& inliers) {
        const std::size_t moving = static_cast<std::size_t>(
            std::count_if(inliers.begin(), inliers.end(), [&](std::size_t i) { return i < on_object; }));
        const bool is_object = 2 * moving > inliers.size();
        EXPECT_LE(5 * (is_object ? inliers.size() - moving : moving), inliers.size()) << "far ones hardly tell";
        const Eigen::Vector3d V = recorded.scene.velocity - (is_object ? 1. : 0.) * recorded.scene.object_velocity;
        EXPECT_GE(result.covariance.rows(), 6);
        EXPECT_LE((result.solutions[0].velocity - V).norm(), 0.3) << on_object << " " << seed;
        return is_object;
      };
      EXPECT_NE(check(found.result, found.inliers), check(found.second->result, found.second->inliers));
    }
    std::printf("  %zu of %zu tracks on a body: %d of %d ambiguous, %d ok\n", on_object, features, ambiguous, trials,
                ok);
    EXPECT_GE(ambiguous, trials - 1);
  }
}

TEST(RobustInitialisation, TracksThatDriftByThemselvesAreNoSecondMotion) {
  int ambiguous = 0;
  constexpr int trials = 40;
  for (std::uint64_t seed = 0; seed < trials; ++seed) {
    const RecordedScene recorded({.scene = {.images = 21, .features = 40}, .bias = 0.02, .noise = adis, .drifting = 20},
                                 1300 + seed);
    ambiguous += initialise(recorded, seed).status == Status::ambiguous;
  }
  EXPECT_LE(ambiguous, 1);
}

TEST(RobustInitialisation, WithoutReadingsOrTracks) {
  const RecordedScene recorded({.scene = {.images = 21, .features = 20}, .bias = 0.03, .noise = adis, .drifting = 6},
                               3);
  const auto found = initialiseRobustly(InertialWindow(recorded.window.motions(), recorded.window.features), options);
  EXPECT_TRUE(found.ok()) << describe(found.status);
  EXPECT_LE((found.gyroscope_bias - recorded.bias).norm(), 0.01);

  const RecordedScene wrong({.scene = {.images = 21, .features = 20}, .drifting = 20, .drift = 0.05}, 8);
  const auto lost = initialise(wrong, 1);
  EXPECT_FALSE(lost.ok());

  const auto fault = [&](const InertialWindow& window, const InitialisationOptions& o) {
    const auto refused = initialiseRobustly(window, o);
    EXPECT_EQ(refused.status, Status::bad_input);
    return refused.result.fault;
  };
  EXPECT_EQ(fault(recorded.window, {}), FaultKind::bad_option);
  EXPECT_EQ(fault({}, options), FaultKind::too_few_images);
  InitialisationOptions bad = options;
  bad.consensus.features_drawn = 0;
  EXPECT_EQ(fault(recorded.window, bad), FaultKind::bad_option);
  InertialWindow window = recorded.window;
  window.features[7][3].bearing.setZero();
  EXPECT_EQ(fault(window, options), FaultKind::bad_bearing);
  window.features.assign(3, {});
  EXPECT_EQ(fault(window, options), FaultKind::no_feature);
}

}  // namespace
