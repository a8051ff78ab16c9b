// stats/detail/pose_sums.hpp against the logarithms and Jacobians of SE3: the same sums and the same barycentre.
#include <lie/se3.hpp>
#include <stats/group_mean.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace {

using namespace liestat;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double eps = std::numeric_limits<double>::epsilon();
constexpr InstructionSet all_sets[] = {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512};

class PoseKernel : public testing::Test {
 protected:
  Vector6 normal(double sigma) {
    Vector6 v;
    for (int i = 0; i < 6; ++i) v[i] = sigma * gauss_(engine_);
    return v;
  }
  /// Poses turned by the angle from y, translations of a metre; q and -q are the same rotation.
  std::vector<SE3d> ring(const SE3d& y, double angle, std::size_t n) {
    std::vector<SE3d> poses;
    for (std::size_t i = 0; i < n; ++i) {
      Vector6 v = normal(1);
      v.tail<3>() *= angle / v.tail<3>().norm();
      poses.push_back(y * SE3d::exp(v));
      if (i % 2) flip(poses.back());
    }
    return poses;
  }
  static void flip(SE3d& x) {
    for (int c = 0; c < 4; ++c) x.data()[c] *= -1;
  }
  std::vector<double> weights(std::size_t n) {
    std::vector<double> p;
    for (std::size_t i = 0; i < n; ++i) p.push_back(0.1 + std::abs(gauss_(engine_)));
    return p;
  }
  template <class W>
  void compare(const std::vector<SE3d>& poses, const W& p, const SE3d& y, double tolerance) {
    constexpr bool weighted = !std::is_same_v<W, detail::UnitWeights>;
    const detail::GroupMeanSums<SE3d> general = detail::groupMeanSums(SerialExecutor{}, poses, p, y);
    for (const InstructionSet set : all_sets) {
      if (set > supportedInstructionSet()) continue;
      SCOPED_TRACE(name(set));
      detail::PoseSums<SE3d> full, light;
      full.add<weighted, true>(set, poses, p, 0, poses.size(), y);
      light.add<weighted, false>(set, poses, p, 0, poses.size(), y);
      EXPECT_EQ(full.refused, 0);
      const double near = tolerance * general.weight;
      EXPECT_NEAR(full.weight, general.weight, near);
      EXPECT_LE((full.sum - general.sum).norm(), near);
      EXPECT_LE((full.jacobian - general.jacobian).norm(), near);
      EXPECT_LE((full.scatter - general.scatter).norm(), near);
      EXPECT_LE((light.sum - general.sum).norm(), near);
      const Eigen::Matrix3d diagonal = general.jacobian.topLeftCorner<3, 3>();
      EXPECT_LE((light.jacobian.topLeftCorner<3, 3>() - diagonal).norm(), near);
    }
  }

  std::mt19937_64 engine_{5};
  std::normal_distribution<double> gauss_;
};

TEST_F(PoseKernel, agrees_at_every_decade_of_the_angle) {
  const SE3d y = SE3d::exp(normal(0.7));
  std::vector<double> angles;
  for (double a = 1e-12; a < 2; a *= 10) angles.push_back(a), angles.push_back(3 * a);
  for (double d = 1; d > 1e-9; d /= 10) angles.push_back(std::numbers::pi - d);
  for (const double angle : angles) {
    SCOPED_TRACE(angle);
    for (const std::size_t n : {1, 3, 64, 67}) {
      const auto poses = ring(y, angle, n);
      compare(poses, detail::UnitWeights{}, y, 400 * eps);
      compare(poses, weights(n), y, 400 * eps);
    }
  }
}

TEST_F(PoseKernel, the_barycentre_is_that_of_the_general_formulas) {
  const SE3d centre = SE3d::exp(normal(2));
  for (const double sigma : {1e-9, 1e-3, 0.2, 0.6}) {
    SCOPED_TRACE(sigma);
    std::vector<SE3d> poses;
    for (int i = 0; i < 2500; ++i) poses.push_back(centre * SE3d::exp(normal(sigma)));
    const GroupMeanResult<SE3d> result = groupMean(poses);
    ASSERT_EQ(result.status, Status::ok);
    const auto general = detail::groupMeanSums(SerialExecutor{}, poses, detail::UnitWeights{}, result.mean);
    EXPECT_LE(general.sum.norm() / 2500, 100 * eps);
    EXPECT_LE((result.jacobian - general.jacobian).norm(), 1e-12 * general.jacobian.norm());
    EXPECT_LE((result.scatter - general.scatter).norm(), 1e-12 * general.scatter.norm() + 2500 * 100 * eps * sigma);
    const Concentration slow = detail::angularConcentration<SE3d>(poses, detail::UnitWeights{}, result.mean);
    EXPECT_NEAR(result.concentration.mean_square, slow.mean_square, 1e-12 * (1 + slow.mean_square));
    EXPECT_NEAR(result.concentration.limit, slow.limit, 1e-12);
    EXPECT_EQ(result.concentration.concentrated, slow.concentrated);
  }
}

TEST_F(PoseKernel, map_coordinates_keep_their_digits) {
  // Millimetres, 5000 km from the origin.
  const SE3d centre(SO3d::exp(Eigen::Vector3d(0.3, -0.2, 0.9)), Eigen::Vector3d(4.1e6, -3.2e5, 4.8e6));
  std::vector<SE3d> poses;
  for (int i = 0; i < 1000; ++i) poses.push_back(centre * SE3d::exp(normal(1e-3)));
  const GroupMeanResult<SE3d> result = groupMean(poses);
  ASSERT_EQ(result.status, Status::ok);
  Vector6 sum = Vector6::Zero();
  for (const SE3d& x : poses) sum += (result.mean.inverse() * x).log();
  EXPECT_LE(sum.norm() / 1000, 8e6 * eps);
}

TEST_F(PoseKernel, what_is_no_rotation_is_left_to_the_general_formulas) {
  auto poses = ring(SE3d(), 0.3, 100);
  for (int c = 0; c < 4; ++c) poses[50].data()[c] *= 1.001;
  detail::PoseSums<SE3d> sums;
  sums.add<false, true>(instructionSet(), poses, detail::UnitWeights{}, 0, poses.size(), SE3d());
  EXPECT_EQ(sums.refused, 1);
  EXPECT_EQ(groupMean(poses).status, Status::ok);
  poses[50].data()[5] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(groupMean(poses).status, Status::not_converged);
}

TEST_F(PoseKernel, single_precision_agrees_with_double) {
  const SE3d centre = SE3d::exp(normal(1));
  std::vector<SE3f> poses;
  std::vector<SE3d> exact;
  for (int i = 0; i < 1500; ++i) {
    poses.push_back((centre * SE3d::exp(normal(0.3))).cast<float>());
    exact.push_back(poses.back().cast<double>());
    Eigen::Map<Eigen::Vector4d>(exact.back().data()).normalize();
  }
  const auto result = groupMean(poses);
  const auto reference = groupMean(exact);
  ASSERT_EQ(result.status, Status::ok);
  EXPECT_LE((reference.mean.inverse() * result.mean.cast<double>()).log().norm(), 2e-6);
  EXPECT_LE((result.dispersion().cast<double>() - reference.dispersion()).norm(), 1e-5 * reference.dispersion().norm());
}

}  // namespace
