// KDL's twists are the errors of the preset ros-fixed at any size, its angles those of ros-rpy.
#include <stats/convention_charts.hpp>
#include <stats/convention_presets.hpp>

#include <support/full_pose.hpp>

#include <gtest/gtest.h>
#include <kdl/frames.hpp>

namespace liestat {
namespace {

using liestat_test::fullGaussian, liestat_test::Vector6;

KDL::Frame frameOf(const SE3d& T) {
  const Eigen::Vector4d q = T.unit_quaternion().coeffs();
  const Eigen::Vector3d p = T.translation();
  return KDL::Frame(KDL::Rotation::Quaternion(q[0], q[1], q[2], q[3]), KDL::Vector(p[0], p[1], p[2]));
}
double gapOf(const KDL::Frame& frame, const SE3d& T) {
  double largest = 0;
  const Eigen::Matrix3d R = T.rotationMatrix();
  for (int i = 0; i < 3; ++i) {
    largest = std::max(largest, std::abs(frame.p(i) - T.translation()[i]));
    for (int j = 0; j < 3; ++j) largest = std::max(largest, std::abs(frame.M(i, j) - R(i, j)));
  }
  return largest;
}

TEST(ConventionKdl, twistsAreErrorsAlongTheWorldsAxes) {
  CounterRng rng(43, 0);
  const Convention fixed = *conventionPreset("ros-fixed");
  for (int trial = 0; trial < 20; ++trial) {
    const SE3d T_hat = fullGaussian(rng).mean;
    Vector6 x = rng.normalVector<6>();
    x.tail<3>() *= 0.7;
    const KDL::Twist twist(KDL::Vector(x[0], x[1], x[2]), KDL::Vector(x[3], x[4], x[5]));
    const SE3d T = conventionExp(fixed, T_hat, x);
    EXPECT_LE(gapOf(KDL::addDelta(frameOf(T_hat), twist), T), 1e-14);
    const KDL::Twist back = KDL::diff(frameOf(T_hat), frameOf(T));
    for (int i = 0; i < 6; ++i) EXPECT_NEAR(back(i), conventionLog(fixed, T_hat, T)[i], 1e-12);
  }
}

TEST(ConventionKdl, anglesAreOurs) {
  CounterRng rng(44, 0);
  const Convention rpy = *conventionPreset("ros-rpy");
  for (int trial = 0; trial < 20; ++trial) {
    const SE3d T_hat = fullGaussian(rng).mean, T = T_hat * SE3d::exp(0.1 * rng.normalVector<6>());
    const Vector6 x = conventionLog(rpy, T_hat, T);
    double a[3], b[3];
    frameOf(T).M.GetRPY(a[0], a[1], a[2]);
    frameOf(T_hat).M.GetRPY(b[0], b[1], b[2]);
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(std::remainder(a[i] - b[i] - x[3 + i], 2 * M_PI), 0, 1e-12);
  }
}

}  // namespace
}  // namespace liestat
