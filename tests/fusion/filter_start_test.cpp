// The start of a filter: levelled, with the covariance that belongs to the errors of each convention; which state of a
// recording it is. Its NEES is judged by `liestat validate vi-init` (nees_filter_start).

#include <fusion/init/filter_start.hpp>
#include <fusion/visual_inertial.hpp>
#include <stats/random.hpp>
#include <support/vi_measurements.hpp>
#include <support/vi_scene.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;
using Vector11 = Eigen::Matrix<double, 11, 1>;
using Vector15 = Eigen::Matrix<double, 15, 1>;
using Eigen::Vector3d;

constexpr double gravity = 9.81, pixel = 1. / 450;

/// A state that is far from level, and a covariance with standard deviations of the size of `scale`.
Gaussian<InertialState> someState(CounterRng& random, double scale) {
  const Vector3d down = random.normalVector<3>().normalized();
  Gaussian<InertialState> state;
  state.mean = InertialState(S2d(down), random.normalVector<3>(), Vector3d(0.01, -0.02, 0.03),
                             Vector3d(Vector3d(0.1, 0.05, -0.2) - gravity * down));
  Eigen::Matrix<double, 11, 11> root;
  for (int i = 0; i < 11; ++i) root.col(i) = scale * random.normalVector<11>();
  state.covariance = root * root.transpose();
  return state;
}

TEST(FilterStart, IsLevelledAndTakesWhatIsFree) {
  CounterRng random(1);
  for (int trial = 0; trial < 20; ++trial) {
    const Gaussian<InertialState> state = someState(random, 0.01);
    const FilterStartOptions options{
        .position = {1, 2, 3}, .heading = 0.1 * trial, .position_sigma = 0.2, .heading_sigma = 0.3};
    const FilterStart start = filterStart(state, gravity, 5, options);
    ASSERT_TRUE(start.ok());
    EXPECT_EQ(start.time, 5);
    const SO3d R(start.state.so3());
    EXPECT_NEAR((R * state.mean.get<0>().unit_vector() + Vector3d::UnitZ()).norm(), 0, 1e-14);
    EXPECT_NEAR((R.inverse() * Vector3d(start.state.velocity()) - state.mean.get<1>()).norm(), 0, 1e-14);
    EXPECT_NEAR((start.bias.accelerometer - Vector3d(0.1, 0.05, -0.2)).norm(), 0, 1e-14);
    EXPECT_EQ(Vector3d(start.state.translation()), options.position);
    // Levelled by the shortest rotation: without a heading its axis is horizontal.
    const Vector3d turn = (SO3d::exp(Vector3d(0, 0, -options.heading)) * R).log();
    EXPECT_NEAR(turn.z(), 0, 1e-12);
    // Position and heading are as the options say, and independent of each other.
    const FilterStart::Covariance basalt = start.covarianceAs(FilterConvention::basalt);
    EXPECT_NEAR((basalt.topLeftCorner<3, 3>() - 0.04 * Eigen::Matrix3d::Identity()).norm(), 0, 1e-14);
    EXPECT_NEAR(basalt(5, 5), 0.09, 1e-12);
    EXPECT_NEAR((basalt.block<3, 12>(0, 3)).norm(), 0, 1e-14);
    EXPECT_EQ(Eigen::LLT<FilterStart::Covariance>(start.covariance).info(), Eigen::Success);
    EXPECT_EQ(start.covariance, start.covariance.transpose());
  }
}

/// The state and biases with an error of a library's, as its own code applies it.
struct Errant {
  Eigen::Matrix3d R;
  Vector3d p, v;
  ImuBias<double> bias;
};
Errant withError(const FilterStart& start, FilterConvention convention, const Vector15& e) {
  const Eigen::Matrix3d R = start.state.so3().matrix();
  const Vector3d p = start.state.translation(), v = start.state.velocity(), a = e.segment<3>(0), b = e.segment<3>(3),
                 c = e.segment<3>(6), d = e.segment<3>(9), f = e.segment<3>(12);
  const auto turn = [](const Vector3d& x) {
    return x.norm() > 0 ? Eigen::AngleAxisd(x.norm(), x.normalized()).toRotationMatrix()
                        : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  };
  const ImuBias<double> first_gyroscope{start.bias.gyroscope + d, start.bias.accelerometer + f};
  switch (convention) {
    case FilterConvention::openvins: {
      // JPL's quaternion of the world in the body: δq ⊗ q with δq = (θ/2, 1) turns it by Exp(-θ) on the left.
      const Eigen::Matrix3d G_to_I = turn(-a) * R.transpose();
      return {G_to_I.transpose(), p + b, v + c, first_gyroscope};
    }
    case FilterConvention::gtsam:
      return {R * turn(a), p + R * b, v + c, {start.bias.gyroscope + f, start.bias.accelerometer + d}};
    case FilterConvention::basalt:
      return {turn(b) * R, p + a, v + c, first_gyroscope};
    default: {
      const SE23d moved = start.state * SE23d::exp(Eigen::Matrix<double, 9, 1>(e.head<9>()));
      return {moved.so3().matrix(), moved.translation(), moved.velocity(), first_gyroscope};
    }
  }
}

// What a state without a map says of an errant state: downwards, velocity and biases in the body. Through any convention
// its covariance is the one that the start was made of.
TEST(FilterStart, ItsCovarianceIsThatOfTheErrorsOfEachConvention) {
  CounterRng random(2);
  for (const FilterConvention convention :
       {FilterConvention::liestat, FilterConvention::openvins, FilterConvention::gtsam, FilterConvention::basalt}) {
    EXPECT_EQ(named<FilterConvention>(name(convention)), convention);
    const Gaussian<InertialState> state = someState(random, 0.01);
    const FilterStart start = filterStart(state, gravity, 0, {.position_sigma = 0.2, .heading_sigma = 0.3});
    // Derivatives of (state without a map, position, heading) by the errors, by central differences.
    constexpr double h = 1e-6;
    const auto of = [&](const Vector15& e) {
      const Errant x = withError(start, convention, e);
      const Eigen::Matrix3d back = x.R.transpose();
      const Vector3d down = back * -Vector3d::UnitZ();
      const InertialState without_map(S2d(down), Vector3d(back * x.v), x.bias.gyroscope,
                                      Vector3d(x.bias.accelerometer - gravity * down));
      const Vector3d off = SO3d(Eigen::Matrix3d(x.R * start.state.so3().matrix().transpose())).log();
      Vector15 all;
      all << Vector11(log(state.mean, without_map)), x.p - Vector3d(start.state.translation()), off.z();
      return all;
    };
    FilterStart::Covariance J;
    for (int k = 0; k < 15; ++k) J.col(k) = (of(h * Vector15::Unit(k)) - of(-h * Vector15::Unit(k))) / (2 * h);
    const FilterStart::Covariance found = J * start.covarianceAs(convention) * J.transpose();
    FilterStart::Covariance expected = FilterStart::Covariance::Zero();
    expected.topLeftCorner<11, 11>() = state.covariance;
    expected.diagonal().segment<3>(11).setConstant(0.04);
    expected(14, 14) = 0.09;
    // Differences of 1e-6 with values of 10: nine digits.
    EXPECT_LE((found - expected).cwiseAbs().maxCoeff(), 1e-8) << name(convention);
  }
}

TEST(FilterStart, WithoutACovarianceThereIsNone) {
  CounterRng random(3);
  Gaussian<InertialState> state = someState(random, 0.01);
  state.covariance(4, 4) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(filterStart(state, gravity, 0).hasState());
  EXPECT_FALSE(FilterStart{}.hasState());
  EXPECT_TRUE(std::isnan(FilterStart{}.covariance(0, 0)));
}

/// A recording at ten images a second; moving, or at rest.
struct Recorded {
  Scene scene;
  std::vector<ImuSample<double>> readings;
  VisualInertialRecording recording;

  Recorded(double seconds, bool rest)
      : scene({.images = static_cast<std::size_t>(10 * seconds) + 1,
               .features = 25,
               .motion = rest ? SceneMotion::stationary : SceneMotion::varying,
               .window = seconds},
              7) {
    const ImuNoise<double> imu{1.7e-4, 2e-3};
    CounterRng random(3);
    readings = readingsOf(scene, imu, random);
    scene.addNoise(pixel, random);
    recording = {.readings = readings,
                 .noise = imu,
                 .image_times = scene.times,
                 .cameras = scene.window.cameras,
                 .observations = {}};
    for (std::size_t i = 0; i < scene.window.features.size(); ++i) {
      for (const TrackedBearing& seen : scene.window.features[i]) {
        recording.observations.push_back({.image = seen.image, .track = i, .bearing = seen.bearing, .sigma = pixel});
      }
    }
  }
};

TEST(FilterStart, IsTheEndOfTheLastStretchThatIsOk) {
  const Recorded recorded(7, false);
  VisualInertialResult result = initialiseRecording(recorded.recording, {.stride = 2.2});
  ASSERT_EQ(result.stretches.size(), 1u);
  const FusedStretch& stretch = result.stretches[0];
  ASSERT_TRUE(stretch.ok());
  EXPECT_TRUE(result.filter_start.ok());
  EXPECT_FALSE(result.filter_start.from_rest);
  EXPECT_EQ(result.filter_start.time, stretch.end);
  EXPECT_EQ(result.filter_start.bias.gyroscope, stretch.state.mean.get<2>());
  // The windows contradict each other: none. Without stretches: that of the last window, untested. Without windows: none.
  result.stretches[0].p = 1e-9;
  FilterStart start = filterStart(result);
  EXPECT_STREQ(start.word(), "inconsistent");
  EXPECT_FALSE(start.hasState());
  result.stretches.clear();
  start = filterStart(result);
  EXPECT_STREQ(start.word(), "untested");
  EXPECT_FALSE(start.ok());
  EXPECT_TRUE(start.hasState());
  EXPECT_EQ(start.time, result.windows.back().end);
  EXPECT_TRUE(start.covariance.allFinite());
  result.windows.clear();
  EXPECT_STREQ(filterStart(result).word(), "no_state");
}

TEST(FilterStart, FromRest) {
  const Recorded recorded(3, true);
  const VisualInertialResult result = initialiseRecording(recorded.recording, {});
  ASSERT_FALSE(result.windows.empty());
  ASSERT_EQ(result.windows.back().verdict(), FusionStatus::stationary);
  const FilterStart& start = result.filter_start;
  ASSERT_TRUE(start.ok()) << start.word();
  EXPECT_TRUE(start.from_rest);
  EXPECT_EQ(start.time, result.windows.back().end);
  EXPECT_LE(start.state.velocity().norm(), 1e-6);
  // What a body that rests may shake.
  EXPECT_NEAR(std::sqrt(start.covariance(7, 7)), FilterStartOptions{}.rest_speed_sigma, 1e-5);
  const Vector3d up = SO3d(start.state.so3()).inverse() * Vector3d::UnitZ();
  const Vector3d truth = recorded.scene.attitude(start.time).inverse() * Vector3d::UnitZ();
  // The accelerometer's bias, of 0.15 m/s² by its prior, tilts it by as many hundredths of a radian at one sigma.
  EXPECT_LE((up - truth).norm(), 4 * 0.15 / gravity);
}

}  // namespace
