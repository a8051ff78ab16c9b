// Every operation of a group differentiates through ceres::Jet, at zero, at tiny angles, in general and near pi, and
// the derivatives agree with the analytic Jacobians.
#pragma once

#include <lie/lie.hpp>

#include <support/jets.hpp>

#include <initializer_list>
#include <utility>
#include <vector>

namespace liestat_test {

/// Tangents have `translation` coordinates first, then `rotation` ones (unless told, all the others); for groups with a
/// scale, its logarithm last takes the given values.
template <template <class, int> class Type>
void checkGroup(int translation, std::initializer_list<double> scales = {}, int rotation = 0) {
  using G = Type<double, 0>;
  constexpr int n = G::DoF;
  using J = Type<Jet, 0>;
  std::vector<std::pair<double, typename G::Tangent>> inputs;
  for (const double angle : swept_angles) {
    if (scales.size() == 0) inputs.push_back({angle, tangent<n>(angle, translation, rotation)});
    for (const double sigma : scales) {
      typename G::Tangent v;
      v << tangent<n - 1>(angle, translation), sigma;
      inputs.push_back({angle, v});
    }
  }
  for (const auto& [angle, v] : inputs) {
    const typename G::Tangent u = tangent<n>(1.1, translation, rotation);
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

    // On parameters.
    expectNear(derivative((x_jet * J::exp(d)).params()), x.Dx_this_mul_exp_x_at_0(), some_eps, "product", angle);
    expectNear(derivative(J::exp(w).params()), G::Dx_exp_x(v), some_eps, "Dx_exp_x", angle);
    if (angle < 3.1) {
      const typename J::Params moved = J::exp(w).params();
      expectNear(G::exp(v).Dx_log_this_inv_by_x_at_this() * derivative(moved), G::rightJacobian(v), some_eps,
                 "Dx_log_this_inv_by_x_at_this", angle);
    }

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
    const typename G::Point q = value(p);
    expectNear(derivative((x_jet * Point(J::exp(d) * p)).eval()),
               (x.matrix().template topLeftCorner<G::Dim, G::Dim>() * G::Dx_exp_x_times_point_at_0(q)).eval(), some_eps,
               "action by the transformation", angle);
    // double meets Jet.
    expectNear(derivative((x.inverse() * J::exp(w)).log()), G::rightJacobian(v), some_eps, "double by Jet", angle);
    expectNear(derivative((x * Point(J::exp(d) * q)).eval()), derivative((x_jet * Point(J::exp(d) * p)).eval()), 0,
               "double point", angle);
    Eigen::Map<const J> view(x_jet.data());
    expectNear(derivative((view * J::exp(d)).log()), derivative((x_jet * J::exp(d)).log()), some_eps, "view", angle);
  }
}

}  // namespace liestat_test
