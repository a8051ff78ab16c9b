// Covariances in other conventions: each against what a small error does in that convention, and there and back.

#include <lie/lie.hpp>
#include <stats/conventions.hpp>
#include <stats/sampling.hpp>

#include <support/dynamic.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace liestat {
namespace {

using liestat_test::dynamic, liestat_test::fixed, liestat_test::gap, liestat_test::outer;

template <class M>
M randomFeature(CounterRng& rng) {
  if constexpr (requires { M::sampleUniform(rng); }) {
    return M::sampleUniform(rng);
  } else {
    return sampleInCube<M>(rng);
  }
}

template <class M>
Gaussian<M> randomGaussian(CounterRng& rng) {
  constexpr int k = ManifoldTraits<M>::DoF;
  SquareOf<M> A;
  for (int i = 0; i < k; ++i) A.col(i) = rng.normalVector<k>();
  return {randomFeature<M>(rng), fixed<SquareOf<M>>(outer(dynamic(A)) + Eigen::MatrixXd::Identity(k, k))};
}

template <class M>
class ConventionsTest : public testing::Test {};
using Types = testing::Types<SO2d, SO3d, SE2d, SE3d, SE23d, RxSO2d, RxSO3d, Sim2d, Sim3d, Frame2d, Frame3d>;
TYPED_TEST_SUITE(ConventionsTest, Types);

// There and back is a handful of products with matrices whose condition is below 100.
constexpr double rounding = 1e-12;

TYPED_TEST(ConventionsTest, thereAndBack) {
  using M = TypeParam;
  CounterRng rng(1, 0);
  for (int trial = 0; trial < 10; ++trial) {
    const auto g = randomGaussian<M>(rng);
    const Eigen::MatrixXd covariance = dynamic(g.covariance);
    const double tolerance = rounding * covariance.norm();
    const Gaussian<M> there_and_back = fromWorldAxesCovariance(g.mean, worldAxesCovariance(g));
    EXPECT_LT(gap(dynamic(there_and_back.covariance), covariance), tolerance);
    const SquareOf<M> reordered = covarianceInOrder<M>(g.covariance, rotation_first);
    EXPECT_EQ(dynamic(covarianceFromOrder<M>(reordered, rotation_first)), covariance) << "a permutation is exact";
    if constexpr (LieGroup<M>) {
      const Gaussian<M> back = fromLeftCovariance(g.mean, leftCovariance(g));
      EXPECT_LT(gap(dynamic(back.covariance), covariance), tolerance);
    }
  }
}

TYPED_TEST(ConventionsTest, leftErrorsMoveTheWorld) {
  using M = TypeParam;
  if constexpr (LieGroup<M>) {
    CounterRng rng(2, 0);
    const M x = M::sampleUniform(rng);
    const TangentOf<M> e = 0.1 * rng.normalVector<M::DoF>();
    // The covariance of one error vector is its square.
    const TangentOf<M> left = (x * M::exp(e) * x.inverse()).log();
    const SquareOf<M> covariance = leftCovariance(Gaussian<M>{x, fixed<SquareOf<M>>(outer(dynamic(e)))});
    EXPECT_LT(gap(dynamic(covariance), outer(dynamic(left))), rounding);
  }
}

TYPED_TEST(ConventionsTest, worldAxesAreThoseOfTheWorld) {
  using M = TypeParam;
  CounterRng rng(3, 0);
  const M x = randomFeature<M>(rng);
  // First order: an error of 1e-6 has a second order of 1e-12.
  const TangentOf<M> e = 1e-6 * rng.normalVector<ManifoldTraits<M>::DoF>();
  const M y = exp(x, e);
  TangentOf<M> moved = TangentOf<M>::Zero();
  int at = 0;
  if constexpr (requires { x.translation(); }) {
    constexpr int dim = ManifoldTraits<M>::Group::Dim;
    moved.template head<dim>() = y.translation() - x.translation();
    at = dim;
  }
  const auto turn = (y.rotationMatrix() * x.rotationMatrix().transpose()).eval();
  if constexpr (std::decay_t<decltype(turn)>::RowsAtCompileTime == 2) {
    moved[at++] = std::atan2(turn(1, 0), turn(0, 0));
  } else {
    moved.template segment<3>(at) = SO3d(turn).log();
    at += 3;
  }
  if constexpr (requires { x.velocity(); }) moved.template tail<3>() = y.velocity() - x.velocity();
  if constexpr (requires { x.scale(); }) moved[at] = std::log(y.scale() / x.scale());
  const Eigen::MatrixXd covariance =
      dynamic(worldAxesCovariance(Gaussian<M>{x, fixed<SquareOf<M>>(outer(dynamic(e)))}));
  EXPECT_LT(gap(covariance, outer(dynamic(moved))), 1e-4 * covariance.norm());
}

TEST(Conventions, turnsAboutTheOriginMoveWhatIsFarFromIt) {
  // A pose at (10, 0, 0) that is sure but for its heading: about its own place nothing moves, about the origin the
  // position moves by ten times the angle.
  Gaussian<SE3d> g{SE3d::transX(10), SquareOf<SE3d>::Zero()};
  g.covariance(5, 5) = 0.01;
  EXPECT_NEAR(worldAxesCovariance(g)(1, 1), 0, 1e-15);
  EXPECT_NEAR(leftCovariance(g)(1, 1), 100 * 0.01, 1e-13);
}

TEST(Conventions, ordersOfNamedParts) {
  Eigen::Matrix<double, 9, 1> v;
  v << 1, 2, 3, 4, 5, 6, 7, 8, 9;
  Eigen::Matrix<double, 9, 1> expected;
  expected << 4, 5, 6, 7, 8, 9, 1, 2, 3;
  const auto P = tangentPermutation<SE23d>({TangentPart::rotation, TangentPart::velocity, TangentPart::translation});
  EXPECT_EQ((P * v).eval(), expected);
  expected << 4, 5, 6, 1, 2, 3, 7, 8, 9;
  EXPECT_EQ((tangentPermutation<SE23d>(rotation_first) * v).eval(), expected);
  EXPECT_EQ((tangentPermutation<SE2d>(rotation_first) * Eigen::Vector3d(1, 2, 3)).eval(), Eigen::Vector3d(3, 1, 2));
  Eigen::Matrix<double, 7, 1> similarity, other;
  similarity << 1, 2, 3, 4, 5, 6, 7;
  other << 4, 5, 6, 1, 2, 3, 7;
  EXPECT_EQ((tangentPermutation<Sim3d>(rotation_first) * similarity).eval(), other);
  EXPECT_EQ((tangentPermutation<SO3d>(rotation_first) * Eigen::Vector3d(1, 2, 3)).eval(), Eigen::Vector3d(1, 2, 3));
}

TEST(Conventions, nanGivesNan) {
  Gaussian<SE3d> g;
  g.covariance(0, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(leftCovariance(g).allFinite());
  EXPECT_FALSE(worldAxesCovariance(g).allFinite());
  EXPECT_FALSE(covarianceInOrder<SE3d>(g.covariance, rotation_first).allFinite());
}

}  // namespace
}  // namespace liestat
