// The memory that estimates from long lists take at most, beside that of their input, by counting what is allocated.
#include <fusion/evaluate.hpp>
#include <fusion/hand_eye.hpp>
#include <stats/random.hpp>

#include <support/allocations.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

namespace {

using namespace liestat;

/// Bytes that a call holds at most beyond what is held before it.
template <class Call>
double bytesOf(const Call& call) {
  const std::size_t before = tests::bytes_held;
  tests::most_bytes_held = before;
  call();
  return static_cast<double>(tests::most_bytes_held - before);
}

SE3d poseAt(double t) {
  return SE3d(SO3d::rotZ(0.4 * t) * SO3d::rotX(0.8 * std::sin(t)),
              Eigen::Vector3d(3 * std::cos(t), 3 * std::sin(t), 0.1 * t));
}
constexpr std::size_t n = 5000;

// Poses of both sensors are 112 bytes a pair, the stream 64, times 8, the fits of the pairs 64. What is kept of each
// row is far from what the rows have, 880 bytes.
TEST(Memory, OfHandEyeCalibration) {
  const SE3d X(SO3d::rotY(0.3), Eigen::Vector3d(0.1, 0.05, -0.02)), Y(SO3d::rotX(0.5), Eigen::Vector3d(1, 0, 0.3));
  Eigen::Matrix<double, 6, 1> sigma;
  sigma << Eigen::Vector3d::Constant(1e-3), Eigen::Vector3d::Constant(2e-3);
  for (const bool own_covariances : {false, true}) {
    CounterRng rng(1);
    PosePairList list;
    HandEyeOptions options;
    for (std::size_t i = 0; i < n; ++i) {
      const double t = 0.01 * static_cast<double>(i), factor = own_covariances ? 1 + 0.1 * std::sin(t) : 1;
      const Eigen::Matrix<double, 6, 6> V = (factor * sigma.cwiseAbs2()).asDiagonal();
      const auto measured = [&](const SE3d& pose) {
        const Eigen::Matrix<double, 6, 1> e = std::sqrt(factor) * sigma.cwiseProduct(rng.normalVector<6>());
        return Gaussian<SE3d>{pose * SE3d::exp(e), V};
      };
      const Gaussian<SE3d> a = measured(poseAt(t));
      list.push_back({a, measured(Y.inverse() * poseAt(t) * X)});
      options.times.push_back(t), options.stream_of_a.push_back({t, a.mean});
    }
    HandEyeResult result;
    const double bytes =
        bytesOf([&] { result = estimateRobotWorld(std::move(list), std::move(options)); }) / static_cast<double>(n);
    EXPECT_TRUE(result.ok()) << result.inWords();
    EXPECT_LT((result.X.mean.inverse() * X).log().norm(), 1e-3);
    EXPECT_LT(bytes, own_covariances ? 650 : 300);
  }
}

// Both poses 112 bytes, four errors 32, times, rows and pairs 32, a sorted list 8.
TEST(Memory, OfAnEvaluationWithoutCovariances) {
  PoseTrajectory reference, estimate;
  std::vector<SE3d> poses;
  for (std::size_t i = 0; i < n; ++i) {
    const double t = 0.01 * static_cast<double>(i);
    poses.push_back(poseAt(t));
    reference.times.push_back(t), estimate.times.push_back(t + 0.003);
  }
  estimate.times.back() = reference.times.back();
  reference.poses = estimate.poses = NoisyPoses::exact(std::move(poses));
  TrajectoryEvaluation e;
  const double bytes =
      bytesOf([&] {
        e = evaluateTrajectory(reference, std::move(estimate), {.alignment = AlignmentModel::se3, .segments = false});
      }) /
      static_cast<double>(n);
  EXPECT_TRUE(e.ok()) << e.reason;
  EXPECT_EQ(e.matched.size(), n);
  EXPECT_FALSE(e.matched.reference.keepsEach());
  EXPECT_LT(bytes, 200);
}

}  // namespace
