// Every operation of the groups differentiates through ceres::Jet, at zero, at tiny angles, in general and near pi, and
// the derivatives agree with the analytic Jacobians.

#include <lie/lie.hpp>

#include <support/jets.hpp>

#include <gtest/gtest.h>

namespace {

using namespace liestat_test;

template <template <class, int> class Type>
void checkGroup(int translation) {
  using G = Type<double, 0>;
  constexpr int n = G::DoF;
  using Jet = ceres::Jet<double, n>;
  using J = Type<Jet, 0>;
  for (const double angle : swept_angles) {
    const typename G::Tangent v = tangent<n>(angle, translation), u = tangent<n>(1.1, translation);
    const G x = G::exp(v);
    const J x_jet = x.template cast<Jet>();
    const JetVector<n> d = variable<n>(G::Tangent::Zero()), w = variable<n>(v);

    expectNear(derivative((x_jet.inverse() * J::exp(w)).log()), G::rightJacobian(v), some_eps, "rightJacobian", angle);
    expectNear(derivative((J::exp(w) * x_jet.inverse()).log()), G::leftJacobian(v), some_eps, "leftJacobian", angle);
    expectNear(derivative((x_jet * J::exp(d)).log()), G::rightJacobianInverse(x.log()), some_eps, "right inverse",
               angle);
    expectNear(derivative((J::exp(d) * x_jet).log()), G::leftJacobianInverse(x.log()), some_eps, "left inverse", angle);
    expectNear(derivative(J::exp(w).log()), Eigen::MatrixXd::Identity(n, n), some_eps, "log exp", angle);
    expectNear(derivative((x_jet * J::exp(d) * x_jet.inverse()).log()), x.Adj(), some_eps, "Adj", angle);
    // d/ds Adj(Exp(s v)) u = ad(v) u: linear in v, so its derivative by v is that of the bracket.
    expectNear(derivative(typename J::Tangent(J::exp(d).Adj() * u.template cast<Jet>())), -G::ad(u), some_eps, "ad",
               angle);

    J normalized = J::exp(w);
    normalized.normalize();
    expectFinite(normalized.params(), "normalize", angle);
    expectFinite(J::exp(w).matrix(), "matrix", angle);
    expectFinite(J::exp(w).Adj(), "Adj", angle);
    expectFinite(J::leftJacobian(w), "leftJacobian", angle);
    expectFinite(J::leftJacobianInverse(w), "leftJacobianInverse", angle);
    expectFinite(J::rightJacobian(w), "rightJacobian", angle);
    expectFinite(J::rightJacobianInverse(w), "rightJacobianInverse", angle);
    expectNear(value(J::exp(w).params()), x.params(), some_eps, "the value of exp", angle);
    expectNear(value(J::exp(w).log()), G::exp(v).log(), some_eps, "the value of log", angle);
    using Point = typename J::Point;
    Point p;
    for (int i = 0; i < J::Dim; ++i) p[i] = Jet(1 + i);
    expectFinite(Point(J::exp(w) * p), "action", angle);
    Eigen::Map<const J> view(x_jet.data());
    expectNear(derivative((view * J::exp(d)).log()), derivative((x_jet * J::exp(d)).log()), some_eps, "view", angle);
  }
}

TEST(Jet, SO2) { checkGroup<liestat::SO2>(0); }
TEST(Jet, SO3) { checkGroup<liestat::SO3>(0); }
TEST(Jet, SE2) { checkGroup<liestat::SE2>(2); }
TEST(Jet, SE3) { checkGroup<liestat::SE3>(3); }

TEST(Jet, RotationMatrices) {
  using Jet = ceres::Jet<double, 3>;
  for (const double angle : swept_angles) {
    const liestat::SO3d x = liestat::SO3d::exp(tangent<3>(angle, 0));
    const liestat::SO3<Jet> moved = x.cast<Jet>() * liestat::SO3<Jet>::exp(variable<3>(Eigen::Vector3d::Zero()));
    const liestat::SO3<Jet> back(moved.matrix());
    expectNear(derivative((x.cast<Jet>().inverse() * back).log()), Eigen::Matrix3d::Identity(), some_eps, "matrix",
               angle);
  }
}

// The distance has a kink at zero, like |x|: its square does not.
TEST(Jet, SquaredDistance) {
  using Jet = ceres::Jet<double, 3>;
  for (const double angle : swept_angles) {
    const Eigen::Vector3d v = tangent<3>(angle, 0);
    const auto z = liestat::log(liestat::SO3<Jet>(), liestat::SO3<Jet>::exp(variable<3>(v)));
    const Jet half = z.dot(z) * 0.5;
    EXPECT_LE((half.v - v).norm(), some_eps) << "gradient at angle " << angle;
  }
}

}  // namespace
