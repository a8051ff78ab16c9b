// Two cameras in the refinement and in the gyroscope's bias from rotations: each bearing in the axes of its own camera
// and from its own place.

#include <fusion/imu/window.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/epipolar_gyroscope_bias.hpp>
#include <fusion/init/refinement.hpp>
#include <support/vi_measurements.hpp>
#include <support/vi_scene.hpp>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;
using Status = FusionStatus;

constexpr double pixel = 1. / 450;
constexpr ImuNoise<double> imu{1.7e-4, 2e-3};
const InitialisationOptions options{.bearing_noise = pixel,
                                    .prior = {.gyroscope_sigma = 0.01, .accelerometer_sigma = 0.05}};
const SE3d one(SO3d::exp(Eigen::Vector3d(0.1, -0.2, 0.3)), Eigen::Vector3d(0.1, 0, 0.05));
const SE3d other(SO3d::exp(Eigen::Vector3d(-0.3, 0.4, 1.2)), Eigen::Vector3d(-0.2, 0.1, 0));

/// A scene with noise and biases that is seen by `cameras`: feature i in image j by the camera that `whose` names.
struct Recorded {
  Scene scene;
  ImuBias<double> bias;
  InertialWindow window;

  template <class Whose>
  Recorded(const SceneOptions& scene_options, std::uint64_t seed, const std::vector<SE3d>& cameras, double sigma,
           const Whose& whose)
      : Recorded(scene_options, seed, cameras, sigma, whose, CounterRng(seed, 0, 1)) {}

 private:
  template <class Whose>
  Recorded(SceneOptions scene_options, std::uint64_t seed, const std::vector<SE3d>& cameras, double sigma,
           const Whose& whose, CounterRng random)
      : scene((scene_options.bias = options.prior.accelerometer_sigma * random.normalVector<3>(), scene_options),
              seed) {
    bias = {options.prior.gyroscope_sigma * random.normalVector<3>(), scene.options().bias};
    const SO3d back = scene.attitude(0).inverse();
    for (std::size_t i = 0; i < scene.features.size(); ++i) {
      FeatureTrack& track = scene.window.features[i];
      track.clear();
      for (std::size_t j = 0; j < scene.times.size(); ++j) {
        const double t = scene.times[j];
        const SE3d t0_T_body(back * scene.attitude(t),
                             Eigen::Vector3d(back * Eigen::Vector3d(scene.position(t) - scene.position(0))));
        const std::size_t camera = whose(i, j);
        const Eigen::Vector3d direction = (t0_T_body * cameras[camera]).inverse() * scene.features[i];
        track.push_back({.image = j, .bearing = direction.normalized(), .camera = camera});
      }
    }
    const auto readings = readingsOf(scene, imu, random, bias.gyroscope);
    scene.addNoise(sigma, random);
    window = InertialWindow(readings, scene.times, {.preintegration = {.noise = imu}}, scene.window.features, cameras);
  }
};

RefinementResult refineFromClosedForm(const InertialWindow& window) {
  const auto start = solveClosedForm(closedFormWindow(window, {}),
                                     {.bearing_noise = pixel, .closed_form = {.singular_values = false}});
  return start.solutions.empty() ? RefinementResult{} : refine(window, start.solutions[0], {}, options);
}

double squaredDistance(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance) {
  return error.dot(covariance.ldlt().solve(error));
}

// Half of the features are seen by each camera, and all of them by turns: the errors are those of the covariance.
TEST(TwoCameras, RefinementIsConsistent) {
  constexpr std::size_t trials = 40;
  const std::vector<SE3d> cameras{one, other};
  for (const bool by_turns : {false, true}) {
    double nees = 0, cost = 0, dof = 0;
    std::size_t ok = 0;
    for (std::uint64_t trial = 0; trial < trials; ++trial) {
      const Recorded recorded({.images = 11, .features = 20}, 500000 + trial, cameras, pixel,
                              [&](std::size_t i, std::size_t j) { return (by_turns ? j : i) % 2; });
      const RefinementResult refined = refineFromClosedForm(recorded.window);
      ASSERT_EQ(refined.status, Status::ok);
      ok += refined.ok();
      EXPECT_EQ(refined.features_used, 20U);
      cost += refined.cost;
      dof += static_cast<double>(refined.degrees_of_freedom);
      // V and both biases: gravity's length is known, and its covariance singular.
      Eigen::VectorXd error(9);
      error << refined.velocity() - recorded.scene.velocity, refined.bias.gyroscope - recorded.bias.gyroscope,
          refined.bias.accelerometer - recorded.bias.accelerometer;
      nees += squaredDistance(
          error, refined.covariance.of<InitialCovariance::first_velocity, InitialCovariance::gyroscope_bias,
                                       InitialCovariance::accelerometer_bias>());
    }
    EXPECT_GE(ok, trials - 1) << by_turns;
    // Four standard errors of the mean of χ²₉: once in 15000 runs of other seeds.
    EXPECT_NEAR(nees / trials, 9, 4 * std::sqrt(18. / trials)) << by_turns;
    EXPECT_NEAR(cost / dof, 1, 4 * std::sqrt(2 / dof)) << by_turns;
  }
}

// Bearings of the second camera that are taken for the first's are no motion.
TEST(TwoCameras, RefinementTellsThemApart) {
  const std::vector<SE3d> cameras{one, other};
  Recorded recorded({.images = 11, .features = 20}, 510000, cameras, pixel,
                    [](std::size_t i, std::size_t) { return i % 2; });
  EXPECT_TRUE(refineFromClosedForm(recorded.window).ok());
  for (FeatureTrack& track : recorded.window.features) {
    for (TrackedBearing& seen : track) seen.camera = 0;
  }
  EXPECT_FALSE(refineFromClosedForm(recorded.window).ok());
}

// The index is all that says whose a bearing is: twice the same camera is one camera, to the last bit.
TEST(TwoCameras, TheSameTwiceAreOne) {
  const auto byTurns = [](std::size_t i, std::size_t j) { return (i + j) % 2; };
  const auto first = [](std::size_t, std::size_t) { return std::size_t{0}; };
  for (std::uint64_t seed = 520000; seed < 520003; ++seed) {
    const Recorded two({.images = 11, .features = 12}, seed, {one, one}, pixel, byTurns);
    const Recorded single({.images = 11, .features = 12}, seed, {one}, pixel, first);
    const RefinementResult a = refineFromClosedForm(two.window), b = refineFromClosedForm(single.window);
    ASSERT_EQ(a.status, Status::ok);
    ASSERT_EQ(b.status, Status::ok);
    EXPECT_EQ(a.velocity(), b.velocity());
    EXPECT_EQ(a.gravity, b.gravity);
    EXPECT_EQ(a.bias.gyroscope, b.bias.gyroscope);
    EXPECT_EQ(a.bias.accelerometer, b.bias.accelerometer);
    EXPECT_EQ(a.covariance.joint, b.covariance.joint);
    EXPECT_EQ(a.cost, b.cost);
  }
}

// A camera that sees nothing changes nothing, wherever it stands in the list.
TEST(TwoCameras, ABlindOneChangesNoBias) {
  const auto second = [](std::size_t, std::size_t) { return std::size_t{1}; };
  const auto first = [](std::size_t, std::size_t) { return std::size_t{0}; };
  const Recorded with({.images = 21, .features = 20}, 530000, {other, one}, pixel, second);
  const Recorded without({.images = 21, .features = 20}, 530000, {one}, pixel, first);
  const auto a = estimateEpipolarGyroscopeBias(with.window, options);
  const auto b = estimateEpipolarGyroscopeBias(without.window, options);
  ASSERT_EQ(a.status, Status::ok);
  EXPECT_EQ(a.bias, b.bias);
  EXPECT_EQ(a.covariance, b.covariance);
  EXPECT_EQ(a.pairs_used, b.pairs_used);
}

// Pairs of images are those of one camera: bearings that both see give a pair each, and the same minimum.
TEST(TwoCameras, SeenByBothTheBiasStays) {
  const auto first = [](std::size_t, std::size_t) { return std::size_t{0}; };
  InitialisationOptions vague = options;
  vague.prior.gyroscope_sigma = 0.1;
  for (std::uint64_t seed = 540000; seed < 540005; ++seed) {
    const Recorded recorded({.images = 21, .features = 20}, seed, {one, one}, pixel, first);
    InertialWindow both = recorded.window;
    for (FeatureTrack& track : both.features) {
      const FeatureTrack seen = track;
      for (TrackedBearing bearing : seen) {
        bearing.camera = 1;
        track.push_back(bearing);
      }
    }
    const auto a = estimateEpipolarGyroscopeBias(both, vague);
    const auto b = estimateEpipolarGyroscopeBias(recorded.window, vague);
    ASSERT_EQ(a.status, Status::ok);
    ASSERT_EQ(b.status, Status::ok);
    EXPECT_EQ(a.pairs_used, 2 * b.pairs_used);
    // The last step is one that changes the cost by less than 1e-3, a thirtieth of a sigma.
    const double sigma = std::sqrt(b.covariance.trace());
    EXPECT_LE((a.bias - b.bias).norm(), 0.1 * sigma) << seed;
  }
}

TEST(TwoCameras, BiasFromRotationsIsConsistent) {
  constexpr std::size_t trials = 60;
  const std::vector<SE3d> cameras{one, other};
  InitialisationOptions vague = options;
  vague.prior.gyroscope_sigma = 0.1;
  double nees = 0;
  std::size_t ok = 0;
  for (std::uint64_t trial = 0; trial < trials; ++trial) {
    const Recorded recorded({.images = 21, .features = 40}, 550000 + trial, cameras, pixel,
                            [](std::size_t i, std::size_t) { return i % 2; });
    const auto found = estimateEpipolarGyroscopeBias(recorded.window, vague);
    if (!found.ok()) continue;
    ++ok;
    nees += squaredDistance(found.bias - recorded.bias.gyroscope, found.covariance);
  }
  EXPECT_GE(ok, trials - 2);
  // Four standard errors, and a tenth for what is not linear, as with one camera.
  EXPECT_NEAR(nees / static_cast<double>(ok), 3, 4 * std::sqrt(6. / trials) + 0.3);
}

}  // namespace
