// The manifolds under Ceres' own matchers.

#include <lie/compat/ceres.hpp>
#include <lie/lie.hpp>

#include <ceres/manifold_test_utils.h>
#include <gtest/gtest.h>

#include <limits>

namespace {

using namespace liestat;

void checkInvariants(const ceres::Manifold& manifold, const ceres::Vector& x, const ceres::Vector& delta,
                     const ceres::Vector& y) {
  using namespace ceres;
  // The numeric derivatives of the matchers are good to some 1e-9.
  EXPECT_THAT_MANIFOLD_INVARIANTS_HOLD(manifold, x, delta, y, 1e-8);
  EXPECT_THAT(manifold, MinusPlusJacobianIsIdentityAt(x, 1e-14));
}

template <class M>
class CeresInvariants : public testing::Test {};
using Manifolds = testing::Types<Eigen::Vector3d, SO2d, SO3d, SE2d, SE3d, RxSO2d, RxSO3d, Sim2d, Sim3d, SE23d, S2d,
                                 OrientedPointd, Essentiald, Frame2d, Frame3d, SemiOrientedFrame3d, NonOrientedFrame3d,
                                 Product<SO3d, Eigen::Vector3d>>;
TYPED_TEST_SUITE(CeresInvariants, Manifolds);

TYPED_TEST(CeresInvariants, Hold) {
  using M = TypeParam;
  using T = ManifoldTraits<M>;
  const CeresManifold<M> manifold;
  typename T::Tangent v, d;
  for (int i = 0; i < T::DoF; ++i) v[i] = 0.5 - 0.2 * i, d[i] = -0.2 + 0.13 * i;
  const M x = T::expOrigin(v), y = exp(x, typename T::Tangent(-0.5 * d));
  checkInvariants(manifold, detail::ParameterBlock<M>::params(x), d, detail::ParameterBlock<M>::params(y));
}

TEST(CeresManifold, SaysWhenAResultIsNotFinite) {
  const CeresManifold<SO3d> manifold;
  const SO3d x = SO3d::rotX(1);
  Eigen::Vector3d bad(0, std::numeric_limits<double>::quiet_NaN(), 0);
  Eigen::Vector4d moved;
  EXPECT_FALSE(manifold.Plus(x.data(), bad.data(), moved.data()));
  bad.setZero();
  EXPECT_TRUE(manifold.Plus(x.data(), bad.data(), moved.data()));
}

}  // namespace
