// The contract's checks of a Homogeneous manifold: invariants 1 to 7 of lie/concepts.hpp and what follows from them.
#pragma once

#include <lie/detail/contract_inputs.hpp>

namespace liestat {

/// Invariant 1: the placement carries the origin to the point.
inline void checkPlacement(const ManifoldOperations& m, ContractReport& report, const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  detail::ContractBench bench(m, report, options);
  // Compared by logOrigin, not by log(x, ·), in which a wrong placement would cancel.
  bench.overDomain([&](const Vector& v) {
    const Point x = m.expOrigin(v);
    bench.equal("act(placement(x), origin()) == x", m.logOrigin(m.act(m.placement(x), m.origin())), m.logOrigin(x),
                {{"x = expOrigin", v}}, bench.condition(x));
  });
  bench.exact("placement(origin()) is the identity", bench.groupGap(m.group.identity(), m.placement(m.origin())).norm(),
              {{"origin", bench.zero()}});
}

/// Invariant 2: the action is one of the group.
inline void checkAction(const ManifoldOperations& m, ContractReport& report, const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  using Element = ManifoldOperations::Element;
  detail::ContractBench bench(m, report, options);
  bench.overAll([&](const Vector& v) {
    const Vector a = bench.genericGroup(), b = bench.genericGroup();
    const Point x = m.expOrigin(v);
    const Element f = m.group.exp(a), g = m.group.exp(b);
    bench.exact("act(f, act(g, x)) == act(f * g, x)",
                m.log(m.act(m.group.product(f, g), x), m.act(f, m.act(g, x))).norm(),
                {{"x = expOrigin", v}, {"f = Exp", a}, {"g = Exp", b}});
    bench.exact("act(identity, x) == x", m.log(x, m.act(m.group.identity(), x)).norm(), {{"x = expOrigin", v}});
  });
}

/// Invariant 3: expOrigin and logOrigin are inverses, at the origin and everywhere.
inline void checkExpLog(const ManifoldOperations& m, ContractReport& report, const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  detail::ContractBench bench(m, report, options);
  bench.overDomain([&](const Vector& v) {
    const Point x = m.expOrigin(v);
    const double condition = bench.condition(x);
    bench.equal("logOrigin(expOrigin(v)) == v", m.logOrigin(x), v, {{"v", v}}, condition);
    const Vector w = bench.generic();
    const Point y = m.expOrigin(w);
    bench.equal("log(y, exp(y, v)) == v", m.log(y, m.exp(y, v)), v, {{"v", v}, {"y = expOrigin", w}}, condition);
  });
  bench.overAll([&](const Vector& v) {
    const Vector w = bench.generic();
    const Point x = m.expOrigin(v), y = m.expOrigin(w);
    bench.exact("expOrigin(logOrigin(x)) == x", m.log(x, m.expOrigin(m.logOrigin(x))).norm(), {{"x = expOrigin", v}});
    bench.exact("exp(y, log(y, x)) == x", m.log(x, m.exp(y, m.log(y, x))).norm(),
                {{"x = expOrigin", v}, {"y = expOrigin", w}});
  });
}

/// Invariant 4: isotropy(f, x) is what h = placement(f x)⁻¹ f placement(x) does to tangent vectors of the origin; not
/// to first order alone where there is a metric, for h is an isometry then.
inline void checkIsotropy(const ManifoldOperations& m, ContractReport& report, const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Matrix = ManifoldOperations::Matrix;
  using Point = ManifoldOperations::Point;
  using Element = ManifoldOperations::Element;
  detail::ContractBench bench(m, report, options);
  bench.overDomain([&](const Vector& v) {
    const Vector a = bench.genericGroup(), b = bench.generic();
    const Element f = m.group.exp(a);
    const Point x = m.expOrigin(b);
    const Element h = bench.isotropyElement(f, x);
    const Matrix H = m.isotropy(f, x);
    bench.exact("placement(f x)⁻¹ f placement(x) leaves the origin", m.log(m.origin(), m.act(h, m.origin())).norm(),
                {{"f = Exp", a}, {"x = expOrigin", b}});
    bench.derivative("isotropy(f, x) against differences", H,
                     [&](const Vector& d) { return m.logOrigin(m.act(h, m.expOrigin(d))); },
                     {{"f = Exp", a}, {"x = expOrigin", b}});
    if (!m.distance) return;
    const Point p = m.expOrigin(v);
    bench.equal("logOrigin(h expOrigin(v)) == isotropy(f, x) v, h = placement(f x)⁻¹ f placement(x)",
                m.logOrigin(m.act(h, p)), detail::product(H, v), {{"f = Exp", a}, {"x = expOrigin", b}, {"v", v}},
                bench.condition(p));
  });
}

/// Consequences of invariants 4 and 7: the Jacobians of the action by the feature and by the transformation.
inline void checkActionJacobians(const ManifoldOperations& m, ContractReport& report,
                                 const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  using Element = ManifoldOperations::Element;
  detail::ContractBench bench(m, report, options);
  bench.overGroup([&](const Vector& v) {
    const Vector w = bench.generic();
    const Element f = m.group.exp(v);
    const Point x = m.expOrigin(w), fx = m.act(f, x);
    bench.derivative("actionFeatureJacobian against differences", m.actionFeatureJacobian(f, x),
                     [&](const Vector& d) { return m.log(fx, m.act(f, m.exp(x, d))); },
                     {{"f = Exp", v}, {"x = expOrigin", w}});
    bench.derivative("actionTransformationJacobian against differences", m.actionTransformationJacobian(f, x),
                     [&](const Vector& d) { return m.log(fx, m.act(m.group.product(f, m.group.exp(d)), x)); },
                     {{"f = Exp", v}, {"x = expOrigin", w}});
  });
  bench.derivative("originProjection against differences", m.originProjection(),
                   [&](const Vector& d) { return m.logOrigin(m.act(m.group.exp(d), m.origin())); },
                   {{"origin", bench.zero()}});
}

/// Invariant 5: the derivative of the placement, where the placement is smooth.
inline void checkPlacementJacobian(const ManifoldOperations& m, ContractReport& report,
                                   const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Matrix = ManifoldOperations::Matrix;
  using Point = ManifoldOperations::Point;
  using Element = ManifoldOperations::Element;
  detail::ContractBench bench(m, report, options);
  // Where it says that it is smooth nowhere, nothing would be looked at.
  const Vector somewhere = bench.generic();
  bench.exact("the placement is smooth at a point in general position",
              m.isPlacementSmooth(m.expOrigin(somewhere)) ? 0 : std::numeric_limits<double>::infinity(),
              {{"x = expOrigin", somewhere}});
  bench.overAll([&](const Vector& v) {
    const Point x = m.expOrigin(v);
    if (!m.isPlacementSmooth(x)) return;
    const Matrix J = m.placementJacobian(x);
    // A placement turns over the distance to the point where it is not smooth, which shows in its Jacobian's size.
    const double room = 3 / std::max(3.0, J.norm());
    if (room < detail::min_room) return;
    const Element f = m.placement(x);
    bench.derivative(
        "placementJacobian against differences", J,
        [&](const Vector& d) { return bench.groupGap(f, m.placement(m.exp(x, d))); }, {{"x = expOrigin", v}}, room);
  });
}

/// Invariant 6: the derivatives of expOrigin and logOrigin, and the principal chart.
inline void checkExpLogJacobians(const ManifoldOperations& m, ContractReport& report,
                                 const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Matrix = ManifoldOperations::Matrix;
  using Point = ManifoldOperations::Point;
  detail::ContractBench bench(m, report, options);
  bench.overDomain([&](const Vector& v) {
    const Point x = m.expOrigin(v);
    const Matrix dexp = m.dexpOrigin(v), dlog = m.dlogOrigin(x);
    bench.derivative("dexpOrigin against differences", dexp,
                     [&](const Vector& d) { return m.log(x, m.expOrigin(v + d)); }, {{"v", v}});
    bench.equal("dlogOrigin(expOrigin(v)) dexpOrigin(v) == I", detail::product(dlog, dexp), bench.identity(),
                {{"v", v}}, dlog.norm() * std::max(1.0, dlog.norm()));
  });
  bench.overAll([&](const Vector& v) {
    const Point x = m.expOrigin(v);
    const double room = bench.room(x);
    if (room < detail::min_room) return;
    bench.derivative(
        "principalChartJacobian against differences", m.principalChartJacobian(x),
        [&](const Vector& d) { return m.logOrigin(m.exp(x, d)); }, {{"x = expOrigin", v}}, room);
  });
}

/// The error vector log(y, x) and its derivatives by both points, the base's in frames carried in parallel.
inline void checkErrorVector(const ManifoldOperations& m, ContractReport& report, const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Matrix = ManifoldOperations::Matrix;
  using Point = ManifoldOperations::Point;
  detail::ContractBench bench(m, report, options);
  bench.overDomain([&](const Vector& v) {
    const Vector w = bench.generic();
    const Point y = m.expOrigin(w), x = m.exp(y, v);
    const Matrix by_feature = m.errorByFeature(y, x);
    const double condition = std::max(1.0, by_feature.norm());
    bench.equal("errorVector(y, x).z == log(y, x)", m.errorVector(y, x), m.log(y, x), {{"z", v}, {"y = expOrigin", w}});

    // Rounding of a point turns its frame as much as the placement's Jacobian is steep there.
    const double steep = std::max(1.0, m.placementJacobian(x).norm());
    bench.equal("frameTransport(x, y) frameTransport(y, x) == I",
                detail::product(m.frameTransport(x, y), m.frameTransport(y, x)), bench.identity(),
                {{"z", v}, {"y = expOrigin", w}}, condition * steep);
    const double room = bench.room(bench.between(y, x));
    if (room < detail::min_room) return;
    bench.derivative(
        "errorVector by the feature against differences", by_feature,
        [&](const Vector& d) { return m.log(y, m.exp(x, d)); }, {{"z", v}, {"y = expOrigin", w}}, room);
    bench.derivative(
        "errorVector by the base against differences", m.errorByBase(y, x),
        [&](const Vector& d) -> Vector {
          const Point moved = m.exp(y, d);
          // In the frame that was carried to the moved base: frameTransport undone, on the way back.
          return detail::product(m.frameTransport(moved, y), m.log(moved, x));
        },
        {{"z", v}, {"y = expOrigin", w}}, room);
  });
}

/// Where the manifold provides them: derivatives of D(z)ᵀa and L(z)ᵀa with respect to z (docs/theory/means.md, section
/// 4.2), D and L the derivatives of the error vector by the feature and by the base.
inline void checkSecondDerivatives(const ManifoldOperations& m, ContractReport& report,
                                   const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  if (!m.dlogFeatureTransposed || !m.dlogBaseTransposed) return;
  detail::ContractBench bench(m, report, options);
  bench.overDomain([&](const Vector& z) {
    const Vector a = bench.generic();
    const double room = bench.room(m.expOrigin(z));
    if (room < detail::min_room) return;
    bench.derivative(
        "dlogFeatureTransposed against differences", m.dlogFeatureTransposed(z, a),
        [&](const Vector& d) -> Vector {
          return detail::product(detail::transposed(m.dlogOrigin(m.expOrigin(z + d))), a);
        },
        {{"z", z}, {"a", a}}, room);
    bench.derivative(
        "dlogBaseTransposed against differences", m.dlogBaseTransposed(z, a),
        [&](const Vector& d) -> Vector {
          return detail::product(detail::transposed(m.logBaseJacobian(m.expOrigin(z + d))), a);
        },
        {{"z", z}, {"a", a}}, room);
  });
}

/// Where the isotropy is not trivial: results do not depend on the placement. f_x is replaced by f_x∘h, h an element of
/// the isotropy group that turns tangent vectors by H; tangent vectors become H⁻¹v, covariances H⁻¹ΣH⁻ᵀ.
inline void checkPlacementIndependence(const ManifoldOperations& m, ContractReport& report,
                                       const ContractOptions& options = {}) {
  using detail::product;
  using Vector = ManifoldOperations::Vector;
  using Matrix = ManifoldOperations::Matrix;
  using Point = ManifoldOperations::Point;
  using Element = ManifoldOperations::Element;
  if (m.group.dimension == m.dimension) return;
  detail::ContractBench bench(m, report, options);
  bench.overDomain([&](const Vector& v) {
    const Vector a = bench.genericGroup(), b = bench.generic(), c = bench.generic();
    const Element f = m.group.exp(a);
    const Point x = m.expOrigin(b), w = m.expOrigin(c), y = m.exp(x, v);
    const Element h = bench.isotropyElement(f, w);
    const Element turned = m.group.product(m.placement(x), h), turned_inverse = m.group.inverse(turned);
    const Matrix H = m.isotropy(h, m.origin()), H_inverse = m.isotropy(m.group.inverse(h), m.origin());
    const Point p = bench.between(x, y), q = m.act(turned_inverse, y);
    const Matrix dlog_p = m.dlogOrigin(p), dlog_q = m.dlogOrigin(q);
    const double condition = std::max(1.0, dlog_p.norm());
    bench.exact("exp does not depend on the placement",
                m.log(m.exp(x, product(H, v)), m.act(turned, m.expOrigin(v))).norm(),
                {{"v", v}, {"x = expOrigin", b}, {"f = Exp", a}, {"w = expOrigin", c}});
    bench.equal("log does not depend on the placement", product(H, m.logOrigin(q)), m.log(x, y),
                {{"v", v}, {"x = expOrigin", b}, {"f = Exp", a}, {"w = expOrigin", c}}, condition);
    // An arbitrary covariance of y, carried to the covariance of log(x, y) in the frame of x by either placement.
    const auto covariance = [](const Matrix& J) {
      Matrix scaled = J;
      for (Eigen::Index k = 0; k < J.cols(); ++k) scaled.col(k) *= 1 + static_cast<double>(k);
      return product(scaled, detail::transposed(J));
    };
    const Matrix by_p = product(dlog_p, m.isotropy(m.group.inverse(m.placement(x)), y));
    const Matrix by_q = product(H, product(dlog_q, m.isotropy(turned_inverse, y)));
    if (!(by_p.norm() < 1e3)) return;
    bench.equal("the covariance of log(x, y) does not depend on the placement", covariance(by_p), covariance(by_q),
                {{"v", v}, {"x = expOrigin", b}, {"f = Exp", a}}, std::pow(condition, 4));
    bench.equal("the derivative of log by the base does not depend on the placement", m.logBaseJacobian(p),
                product(product(H, m.logBaseJacobian(q)), H_inverse), {{"v", v}, {"x = expOrigin", b}, {"f = Exp", a}},
                std::pow(condition, 2));
  });
}

}  // namespace liestat
