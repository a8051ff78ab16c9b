// exp, log and their Jacobians on every manifold differentiate through ceres::Jet, at zero, at tiny angles, in general
// and near pi, and the derivatives agree with the analytic ones.

#include <lie/lie.hpp>

#include <support/jets.hpp>
#include <support/products.hpp>

#include <gtest/gtest.h>

#include <algorithm>

namespace {

using namespace liestat_test;

template <template <class, int> class Type>
void checkManifold(int translation, double limit) {
  using M = Type<double, 0>;
  using T = liestat::ManifoldTraits<M>;
  constexpr int n = T::DoF;
  using J = Type<Jet, 0>;
  using TJ = liestat::ManifoldTraits<J>;
  for (const double angle : swept_angles) {
    if (angle >= limit) continue;
    const typename T::Tangent v = tangent<n>(angle, translation), u = tangent<n>(0.8, translation);
    const M x = T::expOrigin(v), y = liestat::exp(T::expOrigin(u), v);
    const J x_jet = x.template cast<Jet>(), base = T::expOrigin(u).template cast<Jet>();
    const JetVector<n> d = variable<n>(T::Tangent::Zero()), w = variable<n>(v);
    // The sphere's logarithm is as steep as its distance from the antipode is small.
    const double steep = std::max(1.0, T::dlogOrigin(x).norm());

    expectNear(derivative(liestat::log(x_jet, TJ::expOrigin(w))), T::dexpOrigin(v), some_eps, "dexpOrigin", angle);
    expectNear(derivative(TJ::logOrigin(liestat::exp(x_jet, d))), T::dlogOrigin(x), some_eps * steep * steep,
               "dlogOrigin", angle);
    expectNear(derivative(liestat::log(base, liestat::exp(base, w))), Eigen::MatrixXd::Identity(n, n),
               some_eps * steep * steep, "log exp", angle);
    const liestat::ErrorVector<M> e = liestat::errorVector(T::expOrigin(u), y);
    expectNear(derivative(liestat::log(base, liestat::exp(J(y.template cast<Jet>()), d))), e.by_feature,
               some_eps * steep * steep, "errorVector by the feature", angle);
    expectNear(value(TJ::expOrigin(w).params()), x.params(), some_eps, "the value of exp", angle);
    expectFinite(TJ::expOrigin(w).params(), "expOrigin", angle);
    expectFinite(TJ::placement(TJ::expOrigin(w)).params(), "placement", angle);
    expectFinite(TJ::dexpOrigin(w), "dexpOrigin", angle);
    expectFinite(TJ::dlogOrigin(TJ::expOrigin(w)), "dlogOrigin", angle);
    expectFinite(TJ::hessianHalfSquaredDistance(w), "hessianHalfSquaredDistance", angle);
    if constexpr (requires { TJ::dlogFeatureTransposed(w, w); }) {
      expectFinite(TJ::dlogFeatureTransposed(w, w), "dlogFeatureTransposed", angle);
      expectFinite(TJ::dlogBaseTransposed(w, w), "dlogBaseTransposed", angle);
      // The derivative of D(z)ᵀa by automatic differentiation of the first-order Jacobian.
      using Vector = JetVector<n>;
      const Vector a = u.template cast<Jet>();
      expectNear(derivative(Vector(TJ::dlogOrigin(TJ::expOrigin(w)).transpose() * a)), T::dlogFeatureTransposed(v, u),
                 some_eps, "dlogFeatureTransposed", angle);
    }
  }
}

TEST(Jet, SO2) { checkManifold<liestat::SO2>(0, 4); }
TEST(Jet, SO3) { checkManifold<liestat::SO3>(0, 4); }
TEST(Jet, S2) { checkManifold<liestat::S2>(0, 4); }
TEST(Jet, Frame2) { checkManifold<liestat::Frame2>(2, 4); }
TEST(Jet, Frame3) { checkManifold<liestat::Frame3>(3, 4); }
template <class S, int>
using VectorAndRotation = liestat::Product<Vector3<S>, liestat::SO3<S>>;
template <class S, int>
using FrameAndDirectionOf = FrameAndDirection<S>;
TEST(Jet, OrientedPoint) { checkManifold<liestat::OrientedPoint>(3, 4); }
TEST(Jet, Essential) { checkManifold<liestat::Essential>(0, 4); }
TEST(Jet, Products) {
  checkManifold<VectorAndRotation>(3, 4);
  checkManifold<FrameAndDirectionOf>(3, 4);
}
TEST(Jet, Quotients) {
  checkManifold<liestat::SemiOrientedFrame3>(3, EIGEN_PI / 2);
  checkManifold<liestat::NonOrientedFrame3>(3, EIGEN_PI / 2);
}

}  // namespace
