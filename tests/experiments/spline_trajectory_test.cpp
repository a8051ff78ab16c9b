// Smooth motions along splines: rates and forces are the derivatives of the poses.

#include <experiments/simulate_vi.hpp>
#include <experiments/spline_trajectory.hpp>

#include <gtest/gtest.h>

#include <vector>

namespace liestat::experiments {
namespace {

using Eigen::Vector3d;

TEST(SplineTrajectories, RatesAndForcesAreTheDerivatives) {
  const SplineTrajectory motion = builtInTrajectory(3, 7);
  EXPECT_LE(motion.begin(), 1e-12);
  EXPECT_GE(motion.end(), 3);
  const double h = 1e-4;  // central differences leave h² times a third derivative of some 100
  for (double t = 0.01; t < 2.99; t += 0.013) {
    const Kinematics before = motion.at(t - h), at = motion.at(t), after = motion.at(t + h);
    EXPECT_LT(((after.position - before.position) / (2 * h) - at.velocity).norm(), 1e-6) << t;
    EXPECT_LT(((after.velocity - before.velocity) / (2 * h) - at.acceleration).norm(), 1e-5) << t;
    const Vector3d rate = (before.world_R_body.inverse() * after.world_R_body).log() / (2 * h);
    EXPECT_LT((rate - at.angular_rate).norm(), 1e-6) << t;
  }
}

TEST(SplineTrajectories, ReproduceAUniformMotionAndJoinTheirPieces) {
  const Vector3d turn(0.1, -0.2, 0.3), velocity(1, 2, 3);
  std::vector<SE3d> poses;
  for (int i = 0; i < 9; ++i) poses.emplace_back(SO3d::exp(i * turn), 0.5 * i * velocity);
  const SplineTrajectory motion(10, 0.5, poses);
  EXPECT_EQ(motion.begin(), 11);
  EXPECT_EQ(motion.end(), 13);
  for (const double t : {11.0, 11.2, 11.5, 12.3, 13.0}) {
    const Kinematics at = motion.at(t);
    EXPECT_LT((at.position - (t - 10) * velocity).norm(), 1e-13);
    EXPECT_LT((at.velocity - velocity).norm(), 1e-13);
    EXPECT_LT(at.acceleration.norm(), 1e-12);
    EXPECT_LT((at.world_R_body.inverse() * SO3d::exp((t - 10) / 0.5 * turn)).log().norm(), 1e-14);
    EXPECT_LT((at.angular_rate - 2 * turn).norm(), 1e-13);
  }
  // A bend: the pieces on either side of a knot agree in what is said to be continuous.
  poses[4] = SE3d(SO3d::exp(Vector3d(1, 1, 0)), Vector3d(9, -5, 3));
  const SplineTrajectory bent(10, 0.5, poses);
  for (const double knot : {11.5, 12.0, 12.5}) {
    const Kinematics left = bent.at(knot - 1e-9), right = bent.at(knot + 1e-9);
    EXPECT_LT((left.acceleration - right.acceleration).norm(), 1e-5);
    EXPECT_LT((left.angular_rate - right.angular_rate).norm(), 1e-5);
    EXPECT_LT((left.world_R_body.inverse() * right.world_R_body).log().norm(), 1e-7);
  }
}

}  // namespace
}  // namespace liestat::experiments
