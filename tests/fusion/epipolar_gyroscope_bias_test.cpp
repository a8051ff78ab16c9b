// The gyroscope's bias from rotations alone: among drifting tracks, with a covariance that is true, with and without
// parallax, and what it refuses.

#include <fusion/init/detail/epipolar_residual.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/epipolar_gyroscope_bias.hpp>
#include <support/vi_recorded.hpp>

#include <Eigen/Cholesky>
#include <gtest/gtest.h>

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
constexpr ImuNoise<double> adis{1.7e-4, 2e-3};
const InitialisationOptions options{.bearing_noise = pixel};

double squaredDistance(const EpipolarBiasResult& found, const Eigen::Vector3d& bias) {
  const Eigen::Vector3d error = found.bias - bias;
  return error.dot(found.covariance.llt().solve(error));
}

TEST(EpipolarGyroscopeBias, ResidualsOfMatchesByDefinition) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    CounterRng rng(17, seed);
    detail::EpipolarSight a{0, {}, rng.unitVector<3>(), 1e-6}, b{1, {}, rng.unitVector<3>(), 9e-6};
    const Eigen::Vector3d t = rng.unitVector<3>();
    const detail::EpipolarRow row = detail::rowOf(a, b, t);
    // s² but for the term of second order, 100 σ² σ'².
    const double s2 = a.variance * b.u.cross(t).squaredNorm() + b.variance * a.u.cross(t).squaredNorm();
    EXPECT_NEAR(1 / (row.scale * row.scale), s2 + 100 * a.variance * b.variance, 1e-14 * s2) << seed;
    EXPECT_NEAR(row.value, row.scale * t.dot(a.u.cross(b.u)), 1e-12 * row.scale) << seed;
    // By central differences, second order in h and rounding over h: t turned on its sphere, and the second sight turned.
    const double h = 1e-5;
    for (int k = 0; k < 3; ++k) {
      const SO3d turn = SO3d::exp(Eigen::Vector3d(h * Eigen::Vector3d::Unit(k))), back = turn.inverse();
      const Eigen::Vector3d along = Eigen::Vector3d::Unit(k).cross(t);
      const auto of = [&](const Eigen::Vector3d& to) { return detail::rowOf(a, b, to).value; };
      const double by_t = (of(turn * t) - of(back * t)) / (2 * h);
      EXPECT_NEAR(row.by_t.dot(along), by_t, 1e-7 * row.scale) << seed;
      const auto turned = [&](const SO3d& R) {
        detail::EpipolarSight there = b;
        there.u = R * b.u;
        return detail::rowOf(a, there, t).value;
      };
      EXPECT_NEAR(row.by_turn[k], (turned(turn) - turned(back)) / (2 * h), 1e-7 * row.scale) << seed;
    }
  }
}

TEST(EpipolarGyroscopeBias, IsFoundWithoutNoise) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    // A lever arm changes nothing but translations.
    const RecordedScene recorded(
        {.scene = {.images = 21, .features = 12, .camera = {0.2, -0.3, 0.1}}, .bias = 0.1, .sigma = 0}, 300 + seed);
    const auto found = estimateEpipolarGyroscopeBias(recorded.window, options);
    EXPECT_EQ(found.status, Status::ok) << seed;
    EXPECT_EQ(found.inliers.size(), 12u);
    // The prior pulls by covariance · bias / 0.1²; averaged readings are wrong by 1e-5 rad in a second.
    EXPECT_LE((found.bias - recorded.bias).norm(), 2e-5 + found.covariance.trace() * 0.1 / 0.01) << seed;
  }
}

TEST(EpipolarGyroscopeBias, IsFoundAmongDriftingTracks) {
  struct Row {
    double bias, window;
    std::size_t drifting;
    double median, most;  ///< rad/s
  };
  constexpr std::size_t features = 40, trials = 25;
  for (const auto& [bias, window, drifting, median, most] :
       {Row{0, 2, 16, 0.003, 0.015}, Row{0.05, 2, 16, 0.003, 0.015}, Row{0.1, 1, 16, 0.008, 0.04},
        Row{0.1, 2, 20, 0.003, 0.015}, Row{0.1, 4, 16, 0.0015, 0.006}, Row{0.2, 2, 20, 0.003, 0.015}}) {
    std::vector<double> error;
    std::size_t ok = 0, right = 0, wrong = 0;
    int starts = 0;
    for (std::size_t trial = 0; trial < trials; ++trial) {
      const RecordedScene recorded(
          {.scene = {.images = static_cast<std::size_t>(10 * window) + 1, .features = features, .window = window},
           .bias = bias,
           .noise = adis,
           .drifting = drifting},
          200000 + trial);
      const auto found = estimateEpipolarGyroscopeBias(recorded.window, options);
      ok += found.ok();
      starts += found.starts;
      error.push_back((found.bias - recorded.bias).norm());
      for (const std::size_t i : found.inliers) ++(i < drifting ? wrong : right);
      EXPECT_EQ(found.inliers.size() + found.outliers.size(), features);
    }
    std::printf(
        "  %.2f rad/s, %.0f s, %zu of %zu drift: ok %zu of %zu, bias %.5f / %.5f rad/s, precision %.4f, recall "
        "%.4f, %.1f starts\n",
        bias, window, drifting, features, ok, trials, quantileOf(error, 0.5), quantileOf(error, 0.95),
        static_cast<double>(right) / static_cast<double>(right + wrong),
        static_cast<double>(right) / static_cast<double>(trials * (features - drifting)),
        starts / static_cast<double>(trials));
    EXPECT_GE(ok, trials - 1);
    EXPECT_LE(quantileOf(error, 0.5), median);
    EXPECT_LE(quantileOf(error, 0.95), most);
    EXPECT_LE(wrong, right / 100);
    EXPECT_GE(right, trials * (features - drifting) * 98 / 100);
  }
}

TEST(EpipolarGyroscopeBias, CovarianceIsTrue) {
  struct Row {
    const char* what;
    RecordedOptions recorded;
    bool without_parallax = false;
  };
  const SceneOptions moving{.images = 21, .features = 30}, one_second{.images = 11, .features = 30, .window = 1};
  SceneOptions still = moving, far = moving;
  still.motion = SceneMotion::stationary;
  far.far = 1e4;
  constexpr ImuNoise<double> coarse{3e-3, 2e-3};
  constexpr std::size_t trials = 100;
  for (const auto& [what, recorded_options, without_parallax] :
       {Row{"no noise of the gyroscope", {.scene = moving, .bias = 0.05}},
        Row{"much noise of the gyroscope", {.scene = moving, .bias = 0.05, .noise = coarse}},
        Row{"one second", {.scene = one_second, .bias = 0.05, .noise = adis}},
        Row{"drifting tracks", {.scene = moving, .bias = 0.05, .noise = adis, .drifting = 10}},
        Row{"at rest", {.scene = still, .bias = 0.05, .noise = adis, .drifting = 12}, true},
        Row{"pure rotation", {.scene = far, .bias = 0.1, .noise = adis, .drifting = 12}, true}}) {
    double nees = 0, deviation = 0;
    std::size_t right = 0;
    for (std::size_t trial = 0; trial < trials; ++trial) {
      const RecordedScene recorded(recorded_options, 210000 + trial);
      const auto found = estimateEpipolarGyroscopeBias(recorded.window, options);
      if (!found.ok() || found.without_parallax != without_parallax) continue;
      ++right;
      nees += squaredDistance(found, recorded.bias);
      deviation += std::sqrt(found.covariance.trace());
    }
    nees /= static_cast<double>(right);
    std::printf("  %s: NEES %.2f of 3, deviation %.5f rad/s, %zu of %zu ok\n", what, nees,
                deviation / static_cast<double>(right), right, trials);
    EXPECT_GE(right, trials - 2) << what;
    // Four standard errors, and a tenth for what is not linear.
    EXPECT_NEAR(nees, 3, 4 * std::sqrt(6. / static_cast<double>(trials)) + 0.3) << what;
  }
}

// Between no parallax and enough of it there is no answer, and none is given. What it gives instead is off by speed
// over distance.
TEST(EpipolarGyroscopeBias, SaysWhenItIsNotDetermined) {
  std::size_t ok = 0, off = 0;
  for (std::uint64_t trial = 0; trial < 60; ++trial) {
    const RecordedScene recorded(
        {.scene = {.images = 21, .features = 30, .far = 10}, .bias = 0.1, .noise = adis, .drifting = trial % 2 * 10},
        220000 + trial);
    const auto found = estimateEpipolarGyroscopeBias(recorded.window, options);
    EXPECT_LE((found.bias - recorded.bias).norm(), 0.08);
    if (!found.ok() || found.without_parallax) continue;
    ++ok;
    off += squaredDistance(found, recorded.bias) > 30;
  }
  std::printf("  20 to 80 m away: %zu of 60 ok, %zu of these off\n", ok, off);
  EXPECT_LE(off, 1u);

  const RecordedScene few({.scene = {.images = 21, .features = 2}, .bias = 0.05}, 5);
  EXPECT_EQ(estimateEpipolarGyroscopeBias(few.window, options).status, Status::undetermined);
  // All tracks drift: whatever agrees is not most of them, or not noise.
  for (std::uint64_t seed = 0; seed < 5; ++seed) {
    const RecordedScene wrong({.scene = {.images = 21, .features = 20}, .drifting = 20, .drift = 0.05}, seed);
    EXPECT_FALSE(estimateEpipolarGyroscopeBias(wrong.window, options).ok());
  }
}

TEST(EpipolarGyroscopeBias, TracksMayBeShort) {
  // Each is seen by eight images in a row, and one by a single image.
  std::vector<double> error;
  for (std::uint64_t trial = 0; trial < 20; ++trial) {
    RecordedScene recorded({.scene = {.images = 21, .features = 60}, .bias = 0.1, .noise = adis}, 230000 + trial);
    for (std::size_t i = 0; i < 60; ++i) {
      FeatureTrack& track = recorded.window.features[i];
      const std::size_t from = i % 14;
      const auto begin = track.begin() + static_cast<std::ptrdiff_t>(from);
      track = FeatureTrack(begin, begin + (i == 0 ? 1 : 8));
    }
    const auto found = estimateEpipolarGyroscopeBias(recorded.window, options);
    EXPECT_TRUE(found.ok()) << describe(found.status);
    // Neighbours with too little parallax are not used, nor are tracks that only they have.
    EXPECT_LE(found.inliers.size() + found.outliers.size(), 59u);
    EXPECT_GE(found.inliers.size(), 45u);
    EXPECT_TRUE(std::isinf(found.residuals[0]));
    error.push_back((found.bias - recorded.bias).norm());
  }
  EXPECT_LE(quantileOf(error, 0.5), 0.01);
}

TEST(EpipolarGyroscopeBias, RefusesBadInput) {
  const RecordedScene recorded({.scene = {.images = 6, .features = 8}, .bias = 0.02}, 4);
  const auto fault = [&](const InertialWindow& window, const InitialisationOptions& o) {
    const auto found = estimateEpipolarGyroscopeBias(window, o);
    EXPECT_EQ(found.status == Status::bad_input, found.fault != FaultKind::none);
    return found.fault;
  };
  EXPECT_EQ(fault(recorded.window, options), FaultKind::none);
  EXPECT_EQ(fault(recorded.window, {}), FaultKind::bad_option);  // no noise
  InitialisationOptions bad = options;
  bad.prior.gyroscope_sigma = std::numeric_limits<double>::infinity();
  EXPECT_EQ(fault(recorded.window, bad), FaultKind::bad_option);
  bad = options;
  bad.prior.mean.gyroscope[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(fault(recorded.window, bad), FaultKind::bad_option);
  bad = options;
  bad.epipolar.min_consensus = 0;
  EXPECT_EQ(fault(recorded.window, bad), FaultKind::bad_option);
  EXPECT_EQ(fault({}, options), FaultKind::too_few_images);
  InertialWindow window = recorded.window;
  window.features[1][2].image = 77;
  EXPECT_EQ(fault(window, options), FaultKind::wrong_index);
  window = recorded.window;
  window.features[3][1].bearing.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(fault(window, options), FaultKind::bad_bearing);
  window.features.clear();
  EXPECT_EQ(estimateEpipolarGyroscopeBias(window, options).status, Status::undetermined);
}

}  // namespace
