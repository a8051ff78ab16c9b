// stats/detail/maha_groups.hpp against the sums of the manifolds' own operations.
#include <lie/frame3.hpp>
#include <lie/so3.hpp>
#include <stats/maha.hpp>

#include <support/instruction_sets.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace {

using namespace liestat;
using test::instructionSets;

constexpr double eps = std::numeric_limits<double>::epsilon();

template <class M>
class MahaKernelSums : public testing::Test {
 protected:
  static constexpr int k = ManifoldTraits<M>::DoF;
  using Problem = detail::MahaProblem<M, std::vector<Gaussian<M>>>;

  TangentOf<M> normal(double sigma) {
    TangentOf<M> v;
    for (int i = 0; i < k; ++i) v[i] = sigma * gauss_(engine_);
    return v;
  }
  /// Full covariances with deviations from 0.1 to 1.
  SquareOf<M> covariance() {
    SquareOf<M> A;
    for (int i = 0; i < k; ++i) A.col(i) = normal(0.3);
    return A * A.transpose() + 0.01 * SquareOf<M>::Identity();
  }
  std::vector<Gaussian<M>> ring(const M& y, double angle, std::size_t n) {
    std::vector<Gaussian<M>> data;
    for (std::size_t i = 0; i < n; ++i) {
      TangentOf<M> v = normal(1);
      v.template tail<3>() *= angle / v.template tail<3>().norm();
      data.push_back({exp(y, v), covariance()});
      if (i % 2) {
        for (int c = 0; c < 4; ++c) data.back().mean.data()[c] *= -1;
      }
    }
    return data;
  }
  static Problem problem(const std::vector<Gaussian<M>>& data, bool by_kernels) {
    Problem p{data, CovarianceAt::measured, false};
    p.by_kernels = by_kernels;
    for (const Gaussian<M>& g : data) p.append(g.mean, detail::Cholesky<double, k>(g.covariance));
    return p;
  }

  std::mt19937_64 engine_{3};
  std::normal_distribution<double> gauss_;
};
using Manifolds = testing::Types<SO3d, Frame3d>;
TYPED_TEST_SUITE(MahaKernelSums, Manifolds);

TYPED_TEST(MahaKernelSums, agree_at_every_decade_of_the_angle) {
  const TypeParam y = ManifoldTraits<TypeParam>::expOrigin(this->normal(0.7));
  std::vector<double> angles;
  for (double a = 1e-12; a < 3; a *= 10) angles.push_back(a), angles.push_back(3 * a);
  for (double d = 0.1; d > 1e-9; d /= 10) angles.push_back(std::numbers::pi - d);
  const InstructionSet before = instructionSet();
  for (const double angle : angles) {
    SCOPED_TRACE(angle);
    for (const std::size_t n : {1, 7, 8, 200}) {
      const auto data = this->ring(y, angle, n);
      const auto general = this->problem(data, false).evaluate(SerialExecutor{}, y);
      const auto kernels = this->problem(data, true);
      ASSERT_TRUE(kernels.by_kernels);
      for (const InstructionSet set : instructionSets()) {
        SCOPED_TRACE(name(set));
        useInstructionSet(set);
        const auto sums = kernels.evaluate(SerialExecutor{}, y);
        // Terms as large as the information, 100, times vectors as long as π.
        const double near = 200 * 100 * eps * static_cast<double>(n);
        EXPECT_NEAR(sums.cost, general.cost, near);
        EXPECT_LE((sums.gradient - general.gradient).norm(), near);
        EXPECT_LE((sums.gauss_newton - general.gauss_newton).norm(), near);
        EXPECT_LE((sums.hessian - general.hessian).norm(), near);
      }
    }
  }
  useInstructionSet(before);
}

TYPED_TEST(MahaKernelSums, the_estimate_is_a_zero_of_the_general_gradient) {
  const TypeParam centre = ManifoldTraits<TypeParam>::expOrigin(this->normal(0.7));
  std::vector<Gaussian<TypeParam>> data;
  for (int i = 0; i < 1500; ++i) data.push_back({exp(centre, this->normal(0.3)), this->covariance()});
  // The covariances have nothing to do with the scatter.
  const auto result = maha(data, CovarianceAt::measured, {.refutation_level = 0});
  ASSERT_EQ(result.status, Status::ok);
  const auto general = this->problem(data, false).evaluate(SerialExecutor{}, result.mean);
  EXPECT_LE((general.hessian.inverse() * general.gradient).norm(), 1e-13);
  EXPECT_LE((result.hessian - general.hessian).norm(), 1e-12 * general.hessian.norm());
  EXPECT_LE((result.gauss_newton - general.gauss_newton).norm(), 1e-12 * general.gauss_newton.norm());
}

TYPED_TEST(MahaKernelSums, quaternions_far_from_unit_go_the_general_way) {
  auto data = this->ring(TypeParam(), 0.3, 20);
  for (int c = 0; c < 4; ++c) data[12].mean.data()[c] *= 1.001;
  const auto p = this->problem(data, true);
  EXPECT_FALSE(p.by_kernels);
  EXPECT_EQ(p.whitening.size(), data.size());
}

TEST(MahaCovariance, of_two_rotations_by_hand) {
  // Rotations by ±a about one axis, each with the covariance s² I, have their mean at I. Across the axis the Hessian of
  // θ²/2 is c = (a/2) cot(a/2), and J_rᵀ⁻¹ J_r⁻¹ = (a/2)²/sin²(a/2); along it both are one. So H⁻¹ H_GN H⁻¹ is s²/2
  // along and s²/(2 cos²(a/2)) across the axis, where H⁻¹ alone would be s²/(2 c).
  const double a = 1.2, variance = 0.01;
  const Eigen::Vector3d axis(0, 0, a);
  const Eigen::Matrix3d noise = variance * Eigen::Matrix3d::Identity();
  const std::vector<Gaussian<SO3d>> two{{SO3d::exp(axis), noise}, {SO3d::exp(Eigen::Vector3d(-axis)), noise}};
  // So are 128 of them, for kernels, but for the number.
  for (const int copies : {1, 64}) {
    std::vector<Gaussian<SO3d>> data;
    for (int i = 0; i < copies; ++i) data.insert(data.end(), two.begin(), two.end());
    const auto result = maha(data, CovarianceAt::measured, {.refutation_level = 0});
    ASSERT_EQ(result.status, Status::ok);
    const double across = 1 / std::pow(std::cos(a / 2), 2);
    const Eigen::Vector3d expected = variance / (2 * copies) * Eigen::Vector3d(across, across, 1);
    EXPECT_LE((result.covariance - Eigen::Matrix3d(expected.asDiagonal())).norm(), 1e-12 * expected.norm()) << copies;
  }
}

TEST(MahaWeight, is_the_geometric_mean_of_the_information) {
  const Eigen::Matrix3d covariance = Eigen::Vector3d(1, 8, 27).asDiagonal();
  EXPECT_NEAR(scalarWeight(covariance), 1.0 / 6, 1e-15);
}

}  // namespace
