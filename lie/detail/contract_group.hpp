// The contract's checks of the group that acts on a manifold.
#pragma once

#include <lie/detail/contract_inputs.hpp>

namespace liestat {

/// The group that acts on M: axioms, exponential map, adjoint representation, Jacobians, and hat, vee and matrix where
/// it has them. For a group G that acts on itself, the record of G's own operations.
inline void checkGroup(const ManifoldOperations& m, ContractReport& report, const ContractOptions& options = {}) {
  using detail::exponentialSeries, detail::product;
  using Vector = ManifoldOperations::Vector;
  using Matrix = ManifoldOperations::Matrix;
  using Element = ManifoldOperations::Element;
  detail::ContractBench bench(m, report, options);
  const ManifoldOperations::Group& group = m.group;
  const Matrix identity = Matrix::Identity(group.dimension, group.dimension);
  bench.overGroup([&](const Vector& v) {
    const Vector a = bench.genericGroup(), b = bench.genericGroup();
    const Element f = group.exp(v), g = group.exp(a), h = group.exp(b), one = group.identity();
    const Element fg = group.product(f, g), f_inverse = group.inverse(f);
    const auto gap = [&](const Element& left, const Element& right) { return bench.groupGap(left, right).norm(); };
    bench.exact("(f g) h == f (g h)", gap(group.product(fg, h), group.product(f, group.product(g, h))),
                {{"f = Exp", v}, {"g = Exp", a}, {"h = Exp", b}});
    bench.exact("f f⁻¹ == identity", gap(group.product(f, f_inverse), one), {{"f = Exp", v}});
    bench.exact("f⁻¹ f == identity", gap(group.product(f_inverse, f), one), {{"f = Exp", v}});
    bench.exact("identity f == f", gap(group.product(one, f), f), {{"f = Exp", v}});
    bench.equal("Log(Exp(v)) == v", group.log(f), v, {{"v", v}});
    bench.exact("Exp(v)⁻¹ == Exp(-v)", gap(f_inverse, group.exp(-v)), {{"v", v}});
    bench.exact("Exp(0.3 v) Exp(0.7 v) == Exp(v)", gap(group.product(group.exp(0.3 * v), group.exp(0.7 * v)), f),
                {{"v", v}});

    const Matrix Adj_f = group.Adj(f), Adj_g = group.Adj(g);
    bench.exact("g Exp(v) g⁻¹ == Exp(g.Adj() v)",
                gap(group.product(group.product(g, f), group.inverse(g)), group.exp(product(Adj_g, v))),
                {{"g = Exp", a}, {"v", v}}, Adj_g.norm());
    bench.equal("(f g).Adj() == f.Adj() g.Adj()", group.Adj(fg), product(Adj_f, Adj_g),
                {{"f = Exp", v}, {"g = Exp", a}}, Adj_g.norm());
    if (group.ad) {
      bench.equal("Exp(v).Adj() == exp(ad(v)), by the power series", Adj_f, exponentialSeries(group.ad(v)), {{"v", v}},
                  4);
    }

    const Matrix left = group.leftJacobian(v), right = group.rightJacobian(v);
    const Matrix left_inverse = group.leftJacobianInverse(v), right_inverse = group.rightJacobianInverse(v);
    bench.derivative("leftJacobian against differences", left,
                     [&](const Vector& d) { return group.log(group.product(group.exp(v + d), f_inverse)); },
                     {{"v", v}});
    bench.derivative("rightJacobian against differences", right,
                     [&](const Vector& d) { return bench.groupGap(f, group.exp(v + d)); }, {{"v", v}});
    bench.equal("leftJacobianInverse leftJacobian == I", product(left_inverse, left), identity, {{"v", v}},
                left.norm() * left_inverse.norm());
    bench.equal("rightJacobianInverse rightJacobian == I", product(right_inverse, right), identity, {{"v", v}},
                right.norm() * right_inverse.norm());
    bench.equal("leftJacobian(v) == Exp(v).Adj() rightJacobian(v)", left, product(Adj_f, right), {{"v", v}},
                std::max(1.0, right.norm()));

    if (!group.hat || !group.vee || !group.matrix) return;
    const Matrix V = group.hat(v), U = group.hat(a);
    bench.equal("vee(hat(v)) == v", group.vee(V), v, {{"v", v}});
    if (group.ad) {
      bench.equal("ad(v) u == vee(hat(v) hat(u) - hat(u) hat(v))", product(group.ad(v), a),
                  group.vee(product(V, U) - product(U, V)), {{"v", v}, {"u", a}}, 1 + v.norm());
    }
    bench.equal("Exp(v).matrix() == exp(hat(v)), by the power series", group.matrix(f), exponentialSeries(V),
                {{"v", v}});
    bench.equal("(f g).matrix() == f.matrix() g.matrix()", group.matrix(fg), product(group.matrix(f), group.matrix(g)),
                {{"f = Exp", v}, {"g = Exp", a}});
  });
}

}  // namespace liestat
