// Euler angles and axis-angle, to rounding also at gimbal lock and half-turns.

#include <lie/euler.hpp>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string>

namespace {

using namespace liestat;

constexpr double pi = EIGEN_PI;
constexpr double eps = std::numeric_limits<double>::epsilon();

struct Convention {
  EulerAxes axes;
  const char* name;
};
const Convention conventions[] = {{EulerAxes::xyz, "xyz"}, {EulerAxes::xzy, "xzy"}, {EulerAxes::yxz, "yxz"},
                                  {EulerAxes::yzx, "yzx"}, {EulerAxes::zxy, "zxy"}, {EulerAxes::zyx, "zyx"},
                                  {EulerAxes::xyx, "xyx"}, {EulerAxes::xzx, "xzx"}, {EulerAxes::yxy, "yxy"},
                                  {EulerAxes::yzy, "yzy"}, {EulerAxes::zxz, "zxz"}, {EulerAxes::zyz, "zyz"}};

/// By the names alone: the product of the three matrices.
Eigen::Matrix3d product(const std::string& name, const Eigen::Vector3d& angles) {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  for (int i = 0; i < 3; ++i) {
    R = R * Eigen::AngleAxisd(angles[i], Eigen::Vector3d::Unit(name[static_cast<std::size_t>(i)] - 'x')).matrix();
  }
  return R;
}

TEST(Euler, TheNameIsTheProduct) {
  for (const auto& [axes, name] : conventions) {
    const Eigen::Vector3d angles(0.4, 1.1, -2.3);
    EXPECT_LE((fromEuler(axes, angles).matrix() - product(name, angles)).norm(), 8 * eps) << name;
    EXPECT_LE((toEuler(axes, fromEuler(axes, angles)) - angles).norm(), 16 * eps) << name;
  }
}

TEST(Euler, ThereAndBackEverywhere) {
  std::mt19937 generator(2);
  for (const auto& [axes, name] : conventions) {
    const bool proper = name[0] == name[2];
    for (int i = 0; i < 300; ++i) {
      const SO3d R = SO3d::sampleUniform(generator);
      const Eigen::Vector3d angles = toEuler(axes, R);
      EXPECT_LE(angles.cwiseAbs().maxCoeff(), EIGEN_PI);
      EXPECT_GE(angles[1], proper ? 0 : -EIGEN_PI / 2) << name;
      EXPECT_LE(angles[1], proper ? EIGEN_PI : EIGEN_PI / 2 + eps) << name;
      EXPECT_LE((fromEuler(axes, angles).inverse() * R).log().norm(), 16 * eps) << name;
      EXPECT_LE((toEuler(axes, SO3d::fromParams(-R.params())) - angles).norm(), 16 * eps) << "either quaternion";
    }
  }
}

// The distance from gimbal lock is kept to the last digit, where an arc sine keeps half of them.
TEST(Euler, NextToGimbalLock) {
  for (const auto& [axes, name] : conventions) {
    const bool proper = name[0] == name[2];
    for (const double lock : {proper ? 0.0 : -pi / 2, proper ? pi : pi / 2}) {
      for (const double offset : {1e-3, 1e-6, 1e-9, 1e-12, 1e-15, 0.}) {
        const Eigen::Vector3d angles(0.3, lock > 0.1 ? lock - offset : lock + offset, 0.9);
        const SO3d R = fromEuler(axes, angles);
        const Eigen::Vector3d back = toEuler(axes, R);
        EXPECT_NEAR(back[1], angles[1], 4 * eps) << name << " " << offset;
        EXPECT_LE((fromEuler(axes, back).inverse() * R).log().norm(), 16 * eps) << name << " " << offset;
      }
    }
  }
}

TEST(Euler, RollPitchYaw) {
  const SO3d R = fromRollPitchYaw(0.1, -0.2, 0.3);
  EXPECT_LE((R.params() - (SO3d::rotZ(0.3) * SO3d::rotY(-0.2) * SO3d::rotX(0.1)).params()).norm(), 2 * eps);
  EXPECT_LE((toRollPitchYaw(R) - Eigen::Vector3d(0.1, -0.2, 0.3)).norm(), 4 * eps);
  EXPECT_LE((toRollPitchYaw(R.cast<float>()) - Eigen::Vector3f(0.1f, -0.2f, 0.3f)).norm(), 1e-6f);
  EXPECT_TRUE(toRollPitchYaw(fromRollPitchYaw(std::nan(""), 0., 0.)).hasNaN());
}

TEST(AxisAngle, ThereAndBack) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, -2, 0.5).normalized();
  for (const double angle : {1e-12, 1e-6, 0.1, 1.5, 3., pi - 1e-9}) {
    const SO3d R(Eigen::AngleAxisd(angle, axis));
    EXPECT_LE((R.log() - angle * axis).norm(), 8 * eps) << angle;
    const Eigen::AngleAxisd back = R.angleAxis();
    EXPECT_NEAR(back.angle(), angle, 4 * eps);
    EXPECT_LE((back.axis() - axis).norm(), 8 * eps) << angle;
  }
  EXPECT_EQ(SO3d().angleAxis().angle(), 0);
  EXPECT_EQ(SO3d().angleAxis().axis(), Eigen::Vector3d::UnitX()) << "no rotation has an axis";
}

}  // namespace
