// tf2 treats a covariance as the preset ros-fixed says.
#include <stats/convention_presets.hpp>
#include <stats/propagation.hpp>

#include <support/full_pose.hpp>
#include <support/tf2_peer.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

namespace liestat {
namespace {

using liestat_test::fullGaussian, liestat_test::scaledGap, liestat_test::Matrix6;

std::array<double, 4> quaternionOf(const SE3d& T) {
  const Eigen::Vector4d q = T.unit_quaternion().coeffs();
  return {q[0], q[1], q[2], q[3]};
}

TEST(ConventionTf2, transformsAsAnotherWorld) {
  CounterRng rng(41, 0);
  const Convention fixed = *conventionPreset("ros-fixed");
  for (int trial = 0; trial < 20; ++trial) {
    const Gaussian<SE3d> g = fullGaussian(rng);
    const SE3d A = fullGaussian(rng).mean;
    const Matrix6 C = toConvention(fixed, g);
    std::array<double, 36> message{};
    std::copy(C.data(), C.data() + 36, message.begin());
    const auto turned = liestat_test::tf2TransformCovariance(message, quaternionOf(A));
    EXPECT_LE(scaledGap(Eigen::Map<const Matrix6>(turned.data()), toConvention(fixed, act(A, g))), 1e-14);
  }
}

TEST(ConventionTf2, hasOurRollPitchYaw) {
  CounterRng rng(42, 0);
  for (int trial = 0; trial < 20; ++trial) {
    const SE3d T = fullGaussian(rng).mean;
    const auto theirs = liestat_test::tf2RollPitchYaw(quaternionOf(T));
    const Eigen::Vector3d ours = toRollPitchYaw(T.so3());
    for (int i = 0; i < 3; ++i) EXPECT_NEAR(ours[i], theirs[static_cast<std::size_t>(i)], 1e-13);
  }
}

}  // namespace
}  // namespace liestat
