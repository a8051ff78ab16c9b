// stats/detail/planar_group_kernel.hpp against the logarithms and Jacobians of SE2: the same sums and the same barycentre.
#include <lie/se2.hpp>
#include <stats/group_mean.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector3d;

constexpr InstructionSet all_sets[] = {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512};

class PlanarPoses : public testing::Test {
 protected:
  Vector3d normal(double sigma) {
    Vector3d v;
    for (int i = 0; i < 3; ++i) v[i] = sigma * gauss_(engine_);
    return v;
  }
  /// Motions turned by ± the angle from y, translations of a metre.
  std::vector<SE2d> ring(const SE2d& y, double angle, std::size_t n) {
    std::vector<SE2d> motions;
    for (std::size_t i = 0; i < n; ++i) {
      Vector3d v = normal(1);
      v[2] = i % 3 == 1 ? -angle : angle;
      motions.push_back(y * SE2d::exp(v));
    }
    return motions;
  }
  std::vector<double> weights(std::size_t n) {
    std::vector<double> p;
    for (std::size_t i = 0; i < n; ++i) p.push_back(0.1 + std::abs(gauss_(engine_)));
    return p;
  }

  std::mt19937_64 engine_{5};
  std::normal_distribution<double> gauss_;
};

template <class S>
class PlanarPoseKernel : public PlanarPoses {
 protected:
  using Motion = SE2<S>;
  static constexpr double eps = static_cast<double>(std::numeric_limits<S>::epsilon());

  template <class W>
  void compare(const std::vector<SE2d>& exact, const W& p, const SE2d& reference, double tolerance) {
    constexpr bool weighted = !std::is_same_v<W, detail::UnitWeights>;
    std::vector<Motion> motions;
    for (const SE2d& x : exact) motions.push_back(x.template cast<S>());
    const Motion y = reference.template cast<S>();
    // The general formulas in double, at the rounded motions.
    std::vector<SE2d> rounded;
    for (const Motion& x : motions) rounded.push_back(unit(x.template cast<double>()));
    const auto general = detail::groupMeanSums(SerialExecutor{}, rounded, p, unit(y.template cast<double>()));
    for (const InstructionSet set : all_sets) {
      if (set > supportedInstructionSet()) continue;
      SCOPED_TRACE(name(set));
      detail::PoseSums<Motion> full, light;
      full.template add<weighted, true>(set, motions, p, 0, motions.size(), y);
      light.template add<weighted, false>(set, motions, p, 0, motions.size(), y);
      EXPECT_EQ(full.refused, 0);
      const double near = tolerance * general.weight;
      EXPECT_NEAR(full.weight, general.weight, near);
      EXPECT_LE((full.sum.template cast<double>() - general.sum).norm(), near);
      EXPECT_LE((full.jacobian.template cast<double>() - general.jacobian).norm(), near);
      EXPECT_LE((full.scatter.template cast<double>() - general.scatter).norm(), near);
      EXPECT_LE((light.sum.template cast<double>() - general.sum).norm(), near);
      const Eigen::Matrix2d diagonal = general.jacobian.template topLeftCorner<2, 2>();
      EXPECT_LE((light.jacobian.template topLeftCorner<2, 2>().template cast<double>() - diagonal).norm(), near);
    }
  }
  static SE2d unit(SE2d x) {
    Eigen::Map<Eigen::Vector2d>(x.data()).normalize();
    return x;
  }
};
using Scalars = testing::Types<double, float>;
TYPED_TEST_SUITE(PlanarPoseKernel, Scalars);

TYPED_TEST(PlanarPoseKernel, agrees_at_every_decade_of_the_angle) {
  const SE2d y = SE2d::exp(this->normal(0.7));
  std::vector<double> angles;
  for (double a = 1e-12; a < 2; a *= 10) angles.push_back(a), angles.push_back(3 * a);
  // The kernel refuses what is nearer to a half-turn than the direction can be told.
  const double nearest = std::is_same_v<TypeParam, float> ? 1e-3 : 1e-8;
  for (double d = 1; d > nearest; d /= 10) angles.push_back(std::numbers::pi - d);
  for (const double angle : angles) {
    SCOPED_TRACE(angle);
    for (const std::size_t n : {1, 3, 64, 67}) {
      const auto motions = this->ring(y, angle, n);
      this->compare(motions, detail::UnitWeights{}, y, 400 * this->eps);
      this->compare(motions, this->weights(n), y, 400 * this->eps);
    }
  }
}

TYPED_TEST(PlanarPoseKernel, the_barycentre_is_that_of_the_general_formulas) {
  using G = SE2<TypeParam>;
  const SE2d centre = SE2d::exp(this->normal(2));
  for (double sigma = 1e-9; sigma < 1; sigma *= 10) {
    SCOPED_TRACE(sigma);
    std::vector<G> motions;
    std::vector<SE2d> exact;
    for (int i = 0; i < 2500; ++i) {
      motions.push_back((centre * SE2d::exp(this->normal(0.6 * sigma))).template cast<TypeParam>());
      exact.push_back(this->unit(motions.back().template cast<double>()));
    }
    const std::vector<double> p = this->weights(2500);
    for (const bool weighted : {false, true}) {
      const GroupMeanResult<G> result = weighted ? groupMean(motions, p) : groupMean(motions);
      ASSERT_EQ(result.status, Status::ok);
      const std::vector<double> q = weighted ? p : std::vector<double>(2500, 1.0);
      const SE2d mean = this->unit(result.mean.template cast<double>());
      const auto general = detail::groupMeanSums(SerialExecutor{}, exact, q, mean);
      EXPECT_LE(general.sum.norm() / general.weight, 100 * this->eps);
      EXPECT_LE((result.jacobian.template cast<double>() - general.jacobian).norm(),
                4500 * this->eps * general.jacobian.norm());
      EXPECT_LE((result.scatter.template cast<double>() - general.scatter).norm(),
                4500 * this->eps * general.scatter.norm() + general.weight * 100 * this->eps * sigma);
      const Concentration slow = detail::angularConcentration<SE2d>(exact, q, mean);
      EXPECT_NEAR(result.concentration.mean_square, slow.mean_square, 1000 * this->eps * (1 + slow.mean_square));
      EXPECT_NEAR(result.concentration.limit, slow.limit, 1e4 * this->eps);
      EXPECT_EQ(result.concentration.concentrated, slow.concentrated);
    }
  }
}

TEST_F(PlanarPoses, map_coordinates_keep_their_digits) {
  // Millimetres, 5000 km from the origin.
  const SE2d centre(SO2d(0.3), Eigen::Vector2d(4.1e6, -3.2e6));
  std::vector<SE2d> motions;
  for (int i = 0; i < 1000; ++i) motions.push_back(centre * SE2d::exp(normal(1e-3)));
  const GroupMeanResult<SE2d> result = groupMean(motions);
  ASSERT_EQ(result.status, Status::ok);
  Vector3d sum = Vector3d::Zero();
  for (const SE2d& x : motions) sum += (result.mean.inverse() * x).log();
  EXPECT_LE(sum.norm() / 1000, 8e6 * std::numeric_limits<double>::epsilon());
}

TEST_F(PlanarPoses, what_is_no_rotation_is_left_to_the_general_formulas) {
  auto motions = ring(SE2d(), 0.3, 100);
  for (int c = 0; c < 2; ++c) motions[50].data()[c] *= 1.001;
  detail::PoseSums<SE2d> sums;
  sums.add<false, true>(instructionSet(), motions, detail::UnitWeights{}, 0, motions.size(), SE2d());
  EXPECT_EQ(sums.refused, 1);
  EXPECT_EQ(groupMean(motions).status, Status::ok);
  motions[50].data()[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(groupMean(motions).status, Status::not_converged);
}

TEST_F(PlanarPoses, half_turns_from_the_reference_are_left_to_the_general_formulas) {
  std::vector<SE2d> motions = ring(SE2d(), 0.3, 20);
  motions.push_back(SE2d::rot(std::numbers::pi));
  detail::PoseSums<SE2d> sums;
  sums.add<false, true>(instructionSet(), motions, detail::UnitWeights{}, 0, motions.size(), SE2d());
  EXPECT_EQ(sums.refused, 1);
}

}  // namespace
