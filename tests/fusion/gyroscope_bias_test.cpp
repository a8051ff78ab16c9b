// The outer problem over the gyroscope's bias (docs/theory/visual_inertial.md, section 3.6), against the figures of an
// independent prototype, and what it refuses.

#include <fusion/imu/window.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/gyroscope_bias.hpp>
#include <support/vi_measurements.hpp>
#include <support/vi_scene.hpp>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;
using Status = FusionStatus;

constexpr double pixel = 1. / 450;
const InitialisationOptions options{.bearing_noise = pixel, .closed_form = {.singular_values = false}};

struct Recorded {
  Scene scene;
  std::vector<ImuSample<double>> readings;
  Eigen::Vector3d bias;
  InertialWindow window;

  Recorded(const SceneOptions& scene_options, double size, double sigma, const ImuNoise<double>& noise,
           std::uint64_t seed)
      : scene(scene_options, seed) {
    CounterRng random(seed, 0, 1);
    bias = size * random.unitVector<3>();
    readings = readingsOf(scene, noise, random, bias);
    scene.addNoise(sigma, random);
    window = windowOf(scene, readings);
  }
};

double quantile(std::vector<double> values, double p) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(p * static_cast<double>(values.size() - 1))];
}
double tilt(const Eigen::Vector3d& a, const Eigen::Vector3d& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

TEST(BiasedImages, AreWhatIntegrationGives) {
  const Recorded recorded({.images = 9, .features = 3}, 0.02, 0, {}, 11);
  // The largest distance of updated images from integrated ones, for a part of a change.
  const auto distance = [&](double part) {
    const ImuBias<double> bias{part * recorded.bias, part * Eigen::Vector3d(0.05, -0.1, 0.02)};
    const auto updated = biasedImages(recorded.window.motions(), bias);
    const auto anew = motionsOf(recorded.scene, recorded.readings, {.preintegration = {.bias = bias}});
    Preintegration<double> whole({.bias = bias});
    double most = 0;
    for (std::size_t j = 1; j < updated.size(); ++j) {
      whole = whole * anew[j - 1];
      const WindowImage exact = windowImage(whole);
      EXPECT_NEAR(updated[j].image.time, exact.time, 1e-12);
      most = std::max({most, (updated[j].image.rotation - exact.rotation).norm(),
                       (updated[j].image.displacement - exact.displacement).norm()});
    }
    return most;
  };
  EXPECT_LE(distance(0), 1e-13);
  // Second order in the change.
  EXPECT_NEAR(distance(1) / distance(0.5), 4, 0.2);
  EXPECT_LE(distance(1), 1e-3);

  const ImuBias<double> truth{recorded.bias, {0.05, -0.1, 0.02}};
  const auto updated = biasedImages(recorded.window.motions(), truth);
  // Derivatives against central differences of the same function.
  constexpr double h = 1e-6;
  for (int k = 0; k < 3; ++k) {
    ImuBias<double> more = truth, less = truth, pushed = truth, pulled = truth;
    more.gyroscope[k] += h, less.gyroscope[k] -= h;
    pushed.accelerometer[k] += h, pulled.accelerometer[k] -= h;
    const BiasedImage high = biasedImages(recorded.window.motions(), more).back(),
                      low = biasedImages(recorded.window.motions(), less).back(), &at = updated.back();
    const Eigen::Vector3d turn = (SO3d(high.image.rotation) * SO3d(low.image.rotation).inverse()).log() / (2 * h);
    EXPECT_LE((turn - at.rotation_by_gyroscope.col(k)).norm(), 1e-8);
    const Eigen::Vector3d moved = (high.image.displacement - low.image.displacement) / (2 * h);
    EXPECT_LE((moved - at.displacement_by_gyroscope.col(k)).norm(), 1e-7);
    const Eigen::Vector3d slid = (biasedImages(recorded.window.motions(), pushed).back().image.displacement -
                                  biasedImages(recorded.window.motions(), pulled).back().image.displacement) /
                                 (2 * h);
    EXPECT_LE((slid - at.image.displacement_by_bias.col(k)).norm(), 1e-7);
  }
}

TEST(GyroscopeBias, IsFoundWithoutNoise) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Recorded recorded({.images = 21, .features = 12, .camera = {0.05, -0.1, 0.02}}, 0.05, 0, {}, 300 + seed);
    const auto found = estimateGyroscopeBias(recorded.window, options);
    EXPECT_EQ(found.status, Status::ok) << seed;
    // The prior pulls by covariance · bias / 0.1²; averaged readings are wrong by 1e-5 rad in a second; an update of
    // first order by 0.05 rad/s, just below what is integrated anew, by 8e-6 rad in 0.2 s
    // (docs/theory/visual_inertial.md, section 2.2).
    EXPECT_LE((found.bias - recorded.bias).norm(), 2e-5 + 4e-5 + found.covariance.trace() * 0.05 / 0.01) << seed;
  }
}

TEST(GyroscopeBias, MeetsTheTarget) {
  constexpr int trials = 300;
  std::vector<double> bias, scale, degrees, plain_scale, plain_degrees;
  int ok = 0, integrations = 0, iterations = 0, rounds = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const Recorded recorded({.images = 21, .features = 20}, 0.05, pixel, {1.7e-4, 2e-3}, 150000 + trial);
    const Scene& scene = recorded.scene;
    const auto found = estimateGyroscopeBias(recorded.window, options);
    ok += found.ok();
    integrations += found.integrations;
    iterations += found.iterations;
    rounds += found.rounds;
    const auto plain = solveClosedForm(closedFormWindow(recorded.window, {}), options);
    for (const bool first : {true, false}) {
      const auto& result = first ? plain : found.result;
      // A window without a solution counts as lost.
      const bool none = result.solutions.empty();
      const double s = none ? 100 : 100 * std::abs(result.solutions[0].velocity.norm() / scene.velocity.norm() - 1);
      const double d = none ? 90 : tilt(result.solutions[0].gravity, scene.gravity) * 180 / M_PI;
      (first ? plain_scale : scale).push_back(s);
      (first ? plain_degrees : degrees).push_back(d);
    }
    bias.push_back((found.bias - recorded.bias).norm());
  }
  std::printf(
      "  0.05 rad/s over 2 s: bias %.5f / %.5f rad/s, scale %.2f / %.1f %%, gravity %.3f / %.2f deg; ok %d of %d, "
      "%.1f rounds, %.1f iterations, %.1f integrations; without: scale %.1f / %.0f %%, gravity %.2f / %.1f deg\n",
      quantile(bias, 0.5), quantile(bias, 0.95), quantile(scale, 0.5), quantile(scale, 0.95), quantile(degrees, 0.5),
      quantile(degrees, 0.95), ok, trials, 1. * rounds / trials, 1. * iterations / trials, 1. * integrations / trials,
      quantile(plain_scale, 0.5), quantile(plain_scale, 0.95), quantile(plain_degrees, 0.5),
      quantile(plain_degrees, 0.95));
  EXPECT_LE(quantile(bias, 0.5), 0.0017);
  EXPECT_LE(quantile(bias, 0.95), 0.008);
  EXPECT_LE(quantile(scale, 0.5), 2.8);
  EXPECT_LE(quantile(scale, 0.95), 15);
  EXPECT_LE(quantile(degrees, 0.5), 0.2);
  EXPECT_LE(quantile(degrees, 0.95), 0.7);
  EXPECT_GE(ok, trials * 95 / 100);
}

TEST(GyroscopeBias, CovarianceIsThatOfImageNoise) {
  constexpr int trials = 300;
  double nees = 0, cost = 0, degrees = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const Recorded recorded({.images = 21, .features = 20}, 0.02, pixel, {}, 160000 + trial);
    const auto found = estimateGyroscopeBias(recorded.window, options);
    ASSERT_EQ(found.status, Status::ok) << trial;
    const Eigen::Vector3d error = found.bias - recorded.bias;
    nees += error.dot(found.covariance.llt().solve(error)) / trials;
    cost += found.cost;
    // Three unknowns more, and as many rows of their prior.
    degrees += static_cast<double>(found.result.degrees_of_freedom);
  }
  std::printf("  NEES %.2f of 3, cost per degree of freedom %.3f\n", nees, cost / degrees);
  EXPECT_NEAR(nees, 3, 4 * std::sqrt(6. / trials));
  // The true bias is a fifth of the prior's deviation: its rows cost nothing.
  EXPECT_NEAR(cost / degrees, 1, 4 * std::sqrt(2 / degrees) + 3 * trials / degrees);
}

// Both biases at once, and a bias that is twice the prior's deviation.
TEST(GyroscopeBias, WithTheAccelerometersOrLarge) {
  constexpr int trials = 100;
  std::vector<double> error, large;
  for (int trial = 0; trial < trials; ++trial) {
    const std::uint64_t seed = 170000 + static_cast<std::uint64_t>(trial);
    CounterRng random(seed, 0, 2);
    const Recorded both({.images = 21, .features = 20, .bias = 0.1 * random.unitVector<3>()}, 0.05, pixel,
                        {1.7e-4, 2e-3}, seed);
    InitialisationOptions with = options;
    with.closed_form.estimate_bias = true;
    const auto found = estimateGyroscopeBias(both.window, with);
    error.push_back((found.bias - both.bias).norm());

    const Recorded far({.images = 21, .features = 20}, 0.2, pixel, {1.7e-4, 2e-3}, seed);
    const auto from_zero = estimateGyroscopeBias(far.window, options);
    // A bias that has not been found must not be reported as ok.
    if (from_zero.ok()) large.push_back((from_zero.bias - far.bias).norm());
  }
  std::printf("  with the accelerometer's bias %.5f / %.5f rad/s; 0.2 rad/s: %zu of %d ok, %.5f / %.5f rad/s\n",
              quantile(error, 0.5), quantile(error, 0.95), large.size(), trials, quantile(large, 0.5),
              quantile(large, 0.95));
  EXPECT_LE(quantile(error, 0.5), 0.0017);
  EXPECT_LE(quantile(error, 0.95), 0.008);
  EXPECT_GE(large.size(), 90u);
  EXPECT_LE(quantile(large, 0.95), 0.008);
}

TEST(GyroscopeBias, IsNotAskedOfAShortWindow) {
  const Recorded recorded({.images = 11, .features = 20, .window = 1}, 0.02, pixel, {1.7e-4, 2e-3}, 4);
  const auto refused = estimateGyroscopeBias(recorded.window, options);
  EXPECT_EQ(refused.status, Status::window_too_short);
  EXPECT_FALSE(refused.ok());
  // A prior from rest.
  InitialisationOptions from_rest = options;
  from_rest.prior.mean.gyroscope = recorded.bias + Eigen::Vector3d(0.003, -0.002, 0.001);
  from_rest.prior.gyroscope_sigma = 0.003;
  const auto found = estimateGyroscopeBias(recorded.window, from_rest);
  EXPECT_EQ(found.status, Status::ok);
  EXPECT_LE((found.bias - recorded.bias).norm(), 0.01);
}

TEST(GyroscopeBias, RefusesBadInput) {
  const Recorded recorded({.images = 6, .features = 8}, 0.02, pixel, {}, 4);
  const auto fault = [&](const InertialWindow& window, const InitialisationOptions& o) {
    const auto found = estimateGyroscopeBias(window, o);
    return found.status == Status::bad_input ? found.result.fault : FaultKind::none;
  };
  EXPECT_EQ(fault(recorded.window, options), FaultKind::none);
  EXPECT_EQ(fault(recorded.window, {}), FaultKind::bad_option);  // no noise
  InitialisationOptions bad = options;
  bad.prior.gyroscope_sigma = 0;
  EXPECT_EQ(fault(recorded.window, bad), FaultKind::bad_option);
  bad = options;
  bad.prior.mean.gyroscope[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(fault(recorded.window, bad), FaultKind::bad_option);
  EXPECT_EQ(fault({}, options), FaultKind::too_few_images);
  InertialWindow window = recorded.window;
  window.features[1][2].image = 77;
  EXPECT_EQ(fault(window, options), FaultKind::wrong_index);
  window = recorded.window;
  std::vector<Preintegration<double>> motions = window.motions();
  motions[2] = Preintegration<double>();  // no duration
  window = InertialWindow(motions, window.features);
  EXPECT_EQ(fault(window, options), FaultKind::image_order);
  // At rest there is nothing to tell a bias from.
  const Recorded still({.images = 21, .features = 12, .motion = SceneMotion::stationary}, 0, pixel, {}, 4);
  EXPECT_EQ(estimateGyroscopeBias(still.window, options).status, Status::no_start);
}

}  // namespace
