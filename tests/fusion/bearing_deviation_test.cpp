// Bearings with deviations of their own: whatever is estimated is consistent, and a common factor is the same as
// another bearing_noise.

#include <fusion/imu/window.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/consensus.hpp>
#include <fusion/init/epipolar_gyroscope_bias.hpp>
#include <fusion/init/gyroscope_bias.hpp>
#include <fusion/init/refinement.hpp>
#include <fusion/init/robust_initialisation.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <support/small_mahalanobis.hpp>
#include <support/vi_recorded.hpp>

#include <Eigen/Core>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <initializer_list>
#include <limits>
#include <random>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

constexpr double pixel = 1. / 450;
const InitialisationOptions options{.bearing_noise = pixel, .closed_form = {.singular_values = false}};

/// eᵀ C⁻¹ e of the first n unknowns, the second three of which are a gravity of known length: the covariance has no
/// part along it, nor has the error to first order.
template <class Covariance>
double squaredDistance(const Covariance& covariance, std::vector<double> error, int n, const Eigen::Vector3d& gravity) {
  const Eigen::Vector3d along = gravity.normalized();
  detail::SmallMatrix C(n, n);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < n; ++j) C(i, j) = covariance(i, j);
  }
  double part = 0;
  for (int i = 0; n > 3 && i < 3; ++i) {
    part += along[i] * error[3 + static_cast<std::size_t>(i)];
    for (int j = 0; j < 3; ++j) C(3 + i, 3 + j) += along[i] * along[j];
  }
  for (int i = 0; n > 3 && i < 3; ++i) error[3 + static_cast<std::size_t>(i)] -= part * along[i];
  error.resize(static_cast<std::size_t>(n));
  return liestat_test::mahalanobisSquared(C, error);
}
std::vector<double> errorsOf(std::initializer_list<Eigen::Vector3d> parts) {
  std::vector<double> error;
  for (const Eigen::Vector3d& part : parts) error.insert(error.end(), part.data(), part.data() + 3);
  return error;
}

TEST(BearingDeviation, TheClosedFormIsConsistent) {
  constexpr int trials = 300;
  double index = 0, depth = 0, cost = 0, degrees = 0;
  std::vector<double> speed, ignored;
  int depths = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const RecordedScene recorded({.scene = {.images = 21, .features = 20}, .spread = 2},
                                 300000 + static_cast<std::uint64_t>(trial));
    ClosedFormWindow window = closedFormWindow(recorded.window, {});
    const auto result = solveClosedForm(window, options);
    ASSERT_EQ(result.status, FusionStatus::ok);
    const ClosedFormSolution& s = result.solutions[0];
    const Eigen::Vector3d off = s.velocity - recorded.scene.velocity;
    speed.push_back(off.norm());
    index += squaredDistance(result.covariance, errorsOf({off, s.gravity - recorded.scene.gravity}), 6, s.gravity);
    cost += s.cost;
    degrees += static_cast<double>(result.degrees_of_freedom);
    for (std::size_t i = 0; i < window.features.size(); ++i) {
      if (!result.features[i].used) continue;
      const Eigen::Vector3d u = window.features[i].front().bearing;
      depth += std::pow(u.dot(s.features[i] - recorded.scene.features[i]) / result.features[i].depth_sigma, 2);
      ++depths;
    }
    for (FeatureTrack& track : window.features) {
      for (TrackedBearing& seen : track) seen.relative_sigma = 1;
    }
    const auto plain = solveClosedForm(window, options);
    ignored.push_back(plain.solutions.empty() ? 10 : (plain.solutions[0].velocity - recorded.scene.velocity).norm());
  }
  index /= trials;
  std::printf(
      "  NEES %.2f of 5, depths %.2f of 1, cost per degree of freedom %.3f; speed error %.4f, deviations "
      "ignored %.4f m/s\n",
      index, depth / depths, cost / degrees, quantileOf(speed, 0.5), quantileOf(ignored, 0.5));
  EXPECT_NEAR(index, 5, 4 * std::sqrt(2. * 5 / trials));
  // Depths of a window share the error of its scale: as if there were one a window.
  EXPECT_NEAR(depth / depths, 1, 4 * std::sqrt(2. / trials));
  EXPECT_NEAR(cost / degrees, 1, 4 * std::sqrt(2 / degrees) + 0.01);
  EXPECT_LT(quantileOf(speed, 0.5), 0.9 * quantileOf(ignored, 0.5));
}

TEST(BearingDeviation, BiasesAndRefinementAreConsistent) {
  constexpr int trials = 60;
  constexpr ImuNoise<double> adis{1.7e-4, 2e-3};
  const InitialisationOptions refinement{.bearing_noise = pixel,
                                         .prior = {.gyroscope_sigma = 0.03, .accelerometer_sigma = 0.05}};
  double rotation = 0, outer = 0, refined_index = 0, cost = 0, degrees = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const RecordedScene recorded({.scene = {.images = 21, .features = 20}, .bias = 0.03, .noise = adis, .spread = 2},
                                 310000 + static_cast<std::uint64_t>(trial));
    const auto start = estimateEpipolarGyroscopeBias(recorded.window, {.bearing_noise = pixel});
    ASSERT_TRUE(start.ok()) << trial;
    rotation += squaredDistance(start.covariance, errorsOf({start.bias - recorded.bias}), 3, Eigen::Vector3d::UnitZ());
    const auto found = estimateGyroscopeBias(recorded.window, options);
    ASSERT_EQ(found.status, FusionStatus::ok) << trial;
    outer += squaredDistance(found.covariance, errorsOf({found.bias - recorded.bias}), 3, Eigen::Vector3d::UnitZ());
    const auto refined = refine(recorded.window, found.result.solutions.at(0), {.gyroscope = found.bias}, refinement);
    ASSERT_EQ(refined.status, FusionStatus::ok) << trial;
    refined_index += squaredDistance(
        refined.covariance.atFirst(),
        errorsOf({refined.velocity() - recorded.scene.velocity, refined.gravity - recorded.scene.gravity}), 6,
        refined.gravity);
    cost += refined.cost;
    degrees += static_cast<double>(refined.degrees_of_freedom);
  }
  rotation /= trials, outer /= trials, refined_index /= trials;
  std::printf("  NEES: bias by rotations %.2f of 3, with the motion %.2f of 3, refined %.2f of 5; cost %.3f\n",
              rotation, outer, refined_index, cost / degrees);
  const double error = 4 * std::sqrt(6. / trials);
  EXPECT_NEAR(rotation, 3.1, error);
  // The share of the image noise is 3; the gyroscope's adds a tenth.
  EXPECT_NEAR(outer, 3.2, error);
  // The accelerometer's bias is none: below what its prior expects.
  EXPECT_LE(refined_index, 5 + 4 * std::sqrt(10. / trials));
  EXPECT_NEAR(cost / degrees, 1, 4 * std::sqrt(2 / degrees) + 0.01);
}

TEST(BearingDeviation, ConsensusKnowsNoiseFromDrift) {
  std::size_t right = 0, wrong = 0;
  constexpr std::size_t trials = 30, drifting = 16, features = 40;
  for (std::size_t trial = 0; trial < trials; ++trial) {
    const RecordedScene recorded(
        {.scene = {.images = 21, .features = features}, .noise = {1.7e-4, 2e-3}, .spread = 2, .drifting = drifting},
        320000 + trial);
    InitialisationOptions drawn = options;
    drawn.consensus.seed = trial;
    const auto robust = solveClosedFormRobustly(closedFormWindow(recorded.window, {}), drawn);
    for (const std::size_t i : robust.inliers) ++(i < drifting ? wrong : right);
  }
  EXPECT_EQ(wrong, 0u);
  EXPECT_GE(right, trials * (features - drifting) * 99 / 100);
}

// All deviations twice as large, and the noise half of it: nothing changes.
TEST(BearingDeviation, ACommonFactorIsThatOfTheNoise) {
  const RecordedScene recorded(
      {.scene = {.images = 21, .features = 20}, .bias = 0.02, .noise = {1.7e-4, 2e-3}, .spread = 1.5, .drifting = 6},
      17);
  InertialWindow twice = recorded.window;
  for (FeatureTrack& track : twice.features) {
    for (TrackedBearing& seen : track) seen.relative_sigma *= 2;
  }
  const auto solve = [&](const InertialWindow& window, double noise) {
    return initialiseRobustly(window, {.bearing_noise = noise});
  };
  const auto one = solve(recorded.window, pixel), other = solve(twice, pixel / 2);
  ASSERT_TRUE(one.ok());
  EXPECT_EQ(one.inliers, other.inliers);
  EXPECT_EQ(one.hypotheses, other.hypotheses);
  EXPECT_NEAR((one.epipolar.bias - other.epipolar.bias).norm(), 0, 1e-9);
  EXPECT_NEAR((one.epipolar.covariance - other.epipolar.covariance).norm() / one.epipolar.covariance.norm(), 0, 1e-6);
  EXPECT_NEAR((one.gyroscope_bias - other.gyroscope_bias).norm(), 0, 1e-9);
  EXPECT_NEAR((one.bias_covariance - other.bias_covariance).norm() / one.bias_covariance.norm(), 0, 1e-6);
  const ClosedFormResult &a = one.result, &b = other.result;
  EXPECT_EQ(a.status, b.status);
  EXPECT_NEAR((a.solutions[0].velocity - b.solutions[0].velocity).norm(), 0, 1e-8);
  EXPECT_NEAR(a.solutions[0].cost / b.solutions[0].cost, 1, 1e-8);
  EXPECT_NEAR((a.covariance - b.covariance).norm() / a.covariance.norm(), 0, 1e-6);
  for (std::size_t i = 0; i < a.features.size(); ++i) {
    EXPECT_NEAR(a.features[i].residual, b.features[i].residual, 1e-9) << "angles are angles";
    EXPECT_NEAR(a.features[i].parallax, b.features[i].parallax, 1e-9);
    EXPECT_NEAR(a.features[i].used ? 2 * a.features[i].relative_sigma : 1, b.features[i].relative_sigma, 1e-12);
  }
  const auto refined = [&](const InertialWindow& window, double noise) {
    return refine(window, a.solutions[0], {.gyroscope = one.gyroscope_bias}, {.bearing_noise = noise});
  };
  const auto first = refined(recorded.window, pixel), second = refined(twice, pixel / 2);
  EXPECT_NEAR(first.cost / second.cost, 1, 1e-8);
  EXPECT_NEAR((first.covariance.joint - second.covariance.joint).norm() / first.covariance.joint.norm(), 0, 1e-6);
}

TEST(BearingDeviation, MustBePositive) {
  const RecordedScene recorded({.scene = {.images = 6, .features = 8}}, 4);
  for (const double bad :
       {0., -1., std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    InertialWindow window = recorded.window;
    window.features[5][2].relative_sigma = bad;
    const ClosedFormWindow closed = closedFormWindow(window, {});
    const auto result = solveClosedForm(closed, options);
    EXPECT_EQ(result.fault, FaultKind::bad_bearing);
    EXPECT_EQ(result.fault.index, 5u);
    EXPECT_EQ(estimateEpipolarGyroscopeBias(window, {.bearing_noise = pixel}).fault, FaultKind::bad_bearing);
    EXPECT_EQ(estimateGyroscopeBias(window, options).result.fault, FaultKind::bad_bearing);
    ClosedFormSolution start;
    start.gravity = {0, 0, -9.81};
    EXPECT_EQ(refine(window, start, {}, {.bearing_noise = pixel}).fault, FaultKind::bad_bearing);
  }
}

}  // namespace
