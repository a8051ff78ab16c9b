// The closed form on scenes written down by hand: without random numbers, it runs with Eigen and GoogleTest alone.

#include <fusion/init/closed_form.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace {

using namespace liestat;
using Status = FusionStatus;

const Eigen::Vector3d V(0.7, -0.4, 0.2), G = 9.81 * Eigen::Vector3d(0.1, -0.2, -1).normalized();
const std::vector<Eigen::Vector3d> points = {
    {1, 0.5, 4}, {-1, 0.3, 5}, {0.4, -1.1, 3}, {0.2, 0.9, 6}, {-0.7, -0.6, 4.5}};

/// How far the body has gone beyond what V does.
enum class Motion { varying, constant_velocity };
Eigen::Vector3d extra(Motion motion, double t) {
  if (motion == Motion::constant_velocity) return Eigen::Vector3d::Zero();
  // Sines less their tangent at the start.
  return Eigen::Vector3d(0.3 * (std::sin(2 * t) - 2 * t), 0.2 * (1 - std::cos(3 * t)),
                         0.4 * (std::sin(1.5 * t) - 1.5 * t));
}
SO3d attitude(double t) { return SO3d::exp(Eigen::Vector3d(0.3 * std::sin(t), 0.4 * t, -0.2 * std::sin(2 * t))); }

/// n images in two seconds.
ClosedFormWindow window(Motion motion, int n, const Eigen::Vector3d& camera = {0.05, -0.1, 0.02}) {
  ClosedFormWindow w;
  w.features.resize(points.size());
  w.cameras = {SE3d(SO3d::exp(Eigen::Vector3d(0.2, 0.1, -0.3)), camera)};
  for (int j = 0; j < n; ++j) {
    const double t = 2. * j / (n - 1);
    const Eigen::Vector3d p = t * V + extra(motion, t);
    WindowImage image;
    image.time = t;
    image.rotation = attitude(t).matrix();
    // p = t V + t² G/2 + S.
    image.displacement = p - t * V - 0.5 * t * t * G;
    w.images.push_back(image);
    const SE3d t0_T_camera = SE3d(attitude(t), p) * w.cameras[0];
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d direction = t0_T_camera.inverse() * points[i];
      w.features[i].push_back({.image = static_cast<std::size_t>(j), .bearing = direction.normalized()});
    }
  }
  return w;
}

TEST(ClosedFormByHand, FindsVelocityGravityAndFeatures) {
  for (const bool gravity_known : {true, false}) {
    InitialisationOptions options;
    if (!gravity_known) options.gravity.reset();
    const auto found = solveClosedForm(window(Motion::varying, 8), options);
    EXPECT_EQ(found.status, Status::ok);
    EXPECT_TRUE(found.ok());
    EXPECT_EQ(found.null_dimension, 0);
    ASSERT_EQ(found.solutions.size(), 1U);
    const ClosedFormSolution& s = found.solutions[0];
    // Rounding, 1e-16, by the condition of the window, below 1e4.
    EXPECT_LE((s.velocity - V).norm(), 1e-10);
    EXPECT_LE((s.gravity - G).norm(), 1e-10);
    for (std::size_t i = 0; i < points.size(); ++i) EXPECT_LE((s.features[i] - points[i]).norm(), 1e-9) << i;
    EXPECT_EQ(s.negative_depths, 0U);
  }
}

// Bearings that are off by a fifth of a pixel, always to the same side: what comes out is as near as that.
TEST(ClosedFormByHand, NoiseIsBearable) {
  ClosedFormWindow w = window(Motion::varying, 21);
  constexpr double off = 0.2 / 450;
  for (std::size_t i = 0; i < w.features.size(); ++i) {
    for (TrackedBearing& seen : w.features[i]) {
      const double angle = 2.4 * static_cast<double>(7 * i + 3 * seen.image);
      seen.bearing += off * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
    }
  }
  const auto found = solveClosedForm(w, {.bearing_noise = off});
  EXPECT_TRUE(found.ok()) << describe(found.status);
  ASSERT_EQ(found.solutions.size(), 1U);
  // Five predicted standard deviations of the covariance's largest direction.
  Eigen::Matrix<double, 6, 1> error;
  error << found.solutions[0].velocity - V, found.solutions[0].gravity - G;
  ASSERT_EQ(found.covariance.rows(), 6);
  EXPECT_LE(error.norm(), 5 * std::sqrt(found.covariance.trace()));
  EXPECT_LE((found.solutions[0].velocity - V).norm(), 0.05 * V.norm());
}

TEST(ClosedFormByHand, SaysWhatIsNotDetermined) {
  // A lever arm would tell the scale.
  const auto constant = solveClosedForm(window(Motion::constant_velocity, 8, Eigen::Vector3d::Zero()), {});
  EXPECT_EQ(constant.status, Status::scale_unobservable);
  ASSERT_FALSE(constant.solutions.empty());
  EXPECT_LE(constant.solutions[0].velocity.normalized().cross(V.normalized()).norm(), 1e-8);
  EXPECT_LE((constant.solutions[0].gravity - G).norm(), 1e-8);
  EXPECT_EQ(solveClosedForm(window(Motion::varying, 2), {}).status, Status::too_few_images);
}

TEST(ClosedFormByHand, SaysWhatIsWrong) {
  EXPECT_EQ(solveClosedForm({}, {}).fault, FaultKind::too_few_images);
  ClosedFormWindow w = window(Motion::varying, 8);
  w.images[3].displacement.y() = std::numeric_limits<double>::quiet_NaN();
  const auto found = solveClosedForm(w, {});
  EXPECT_EQ(found.status, Status::bad_input);
  EXPECT_EQ(found.fault, Fault(FaultKind::image_not_finite, 3));
}

}  // namespace
