// The contract's checks of a Metric manifold and of a Quotient: invariants 8 to 10 of lie/concepts.hpp.
#pragma once

#include <lie/detail/contract_inputs.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace liestat {

/// Invariant 8: an invariant distance, which geodesics measure.
inline void checkMetric(const ManifoldOperations& m, ContractReport& report, const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  using Element = ManifoldOperations::Element;
  if (!m.distance) return;
  detail::ContractBench bench(m, report, options);
  const auto& d = m.distance;
  bench.overAll([&](const Vector& v) {
    const Vector a = bench.genericGroup(), b = bench.generic(), c = bench.generic();
    const Element f = m.group.exp(a);
    const Point y = m.expOrigin(b), x = m.exp(y, v), w = m.expOrigin(c);
    const double yx = d(y, x);
    bench.exact("distance(f x, f y) == distance(x, y)", std::abs(d(m.act(f, y), m.act(f, x)) - yx),
                {{"f = Exp", a}, {"y = expOrigin", b}, {"log(y, x)", v}});
    bench.exact("distance(x, y) == distance(y, x)", std::abs(d(x, y) - yx), {{"y = expOrigin", b}, {"log(y, x)", v}});
    bench.exact("distance(x, y) <= distance(x, w) + distance(w, y)", std::max(0.0, yx - d(y, w) - d(w, x)),
                {{"y = expOrigin", b}, {"log(y, x)", v}, {"w = expOrigin", c}});
  });
  bench.overDomain([&](const Vector& v) {
    const Vector b = bench.generic();
    const Point y = m.expOrigin(b);
    const double length = std::sqrt((m.metricWeights().array() * v.array() * v.array()).sum());
    bench.exact("distance(y, exp(y, v)) == |v|", std::abs(d(y, m.exp(y, v)) - length),
                {{"y = expOrigin", b}, {"v", v}});
  });
}

/// The injectivity radius: up to it logOrigin inverts expOrigin (invariant 3 is tried up to there), and beyond it some
/// geodesic from the origin is no longer the shortest.
inline void checkInjectivityRadius(const ManifoldOperations& m, ContractReport& report,
                                   const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  if (!m.injectivityRadius || !m.metricWeights) return;
  detail::ContractBench bench(m, report, options);
  const double radius = m.injectivityRadius();
  const Vector root = m.metricWeights().cwiseSqrt();
  // A geodesic of one and a half turns, where there is no bound, is the shortest in flat manifolds only.
  const double length = std::isfinite(radius) ? 1.02 * radius : 3 * static_cast<double>(EIGEN_PI);
  double shortest = 1;
  for (int i = 0; i < m.dimension; ++i) {
    const Vector v = (length / root[i]) * Vector::Unit(m.dimension, i);
    shortest = std::min(shortest, root.cwiseProduct(m.logOrigin(m.expOrigin(v))).norm() / length);
  }
  const bool is_bound = shortest < 0.99;
  bench.exact("injectivityRadius is where the first geodesic along a coordinate stops being the shortest",
              is_bound == std::isfinite(radius) ? 0 : std::numeric_limits<double>::infinity(), {});
}

/// Invariant 9: the Hessian of half the squared distance, along geodesics.
inline void checkHessian(const ManifoldOperations& m, ContractReport& report, const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Matrix = ManifoldOperations::Matrix;
  using Point = ManifoldOperations::Point;
  if (!m.hessianHalfSquaredDistance) return;
  detail::ContractBench bench(m, report, options);
  bench.overDomain([&](const Vector& v) {
    const Vector w = bench.generic();
    const Point y = m.expOrigin(w), x = m.exp(y, v);
    const double room = bench.room(bench.between(y, x));
    if (room < detail::min_room) return;
    const Matrix A = m.hessianHalfSquaredDistance(m.log(y, x));
    bench.equal("hessianHalfSquaredDistance is symmetric", A, detail::transposed(A), {{"z", v}},
                std::max(1.0, A.norm()));
    // By polarisation, the values of the quadratic form at e_i and e_i + e_j determine the matrix.
    for (int i = 0; i < m.dimension; ++i) {
      for (int j = i; j < m.dimension; ++j) {
        Vector e = Vector::Unit(m.dimension, i);
        if (j > i) e = (e + Vector::Unit(m.dimension, j)) / std::sqrt(2.0);
        bench.secondDerivative(
            "hessianHalfSquaredDistance against second differences", e.dot(Vector(detail::product(A, e))),
            [&](double s) {
              const double d = m.distance(m.exp(y, s * e), x);
              return d * d / 2;
            },
            {{"z", v}, {"y = expOrigin", w}, {"direction", e}}, room);
      }
    }
  });
}

/// Invariant 10: no result depends on the representative that a quotient feature is stored as.
inline void checkQuotient(const ManifoldOperations& m, ContractReport& report, const ContractOptions& options = {}) {
  using detail::product;
  using Vector = ManifoldOperations::Vector;
  using Matrix = ManifoldOperations::Matrix;
  using Point = ManifoldOperations::Point;
  if (!m.representative) return;
  detail::ContractBench bench(m, report, options);
  bench.overAll([&](const Vector& v) {
    const Vector b = bench.generic(), c = bench.generic();
    const Point y = m.expOrigin(b), x = m.exp(y, v);
    const double room = bench.room(bench.between(y, x));
    const auto& compact = m.statistics;
    if (m.representativeGap && compact.compactCoordinates && compact.compact_factor == CompactFactor::rotation) {
      std::vector<double> angles;
      for (const int i : m.representatives) {
        const Vector q = compact.compactCoordinates(m.representative(x, i));
        angles.push_back(2 * std::atan2(q.head(3).norm(), std::abs(q[3])));
      }
      std::sort(angles.begin(), angles.end());
      bench.exact("the gap of nearestRepresentative is that of the two least angles",
                  std::abs(m.representativeGap(x) - (angles[1] - angles[0])), {{"log(y, x)", v}, {"y = expOrigin", b}},
                  8);
    }
    for (const int i : m.representatives) {
      const Point x_i = m.representative(x, i), y_i = m.representative(y, i);
      const Matrix K = m.representativeJacobian(i);
      const Vector index = Vector::Constant(1, i);
      if (m.distance) {
        const double d = m.distance(y, x);
        bench.exact("distance does not depend on the representative",
                    std::abs(m.distance(y, x_i) - d) + std::abs(m.distance(y_i, x) - d),
                    {{"log(y, x)", v}, {"y = expOrigin", b}, {"index", index}});
      }
      bench.exact("exp(representative(x, i), representativeJacobian(i) v) == exp(x, v)",
                  m.log(m.exp(x, c), m.exp(x_i, product(K, c))).norm(),
                  {{"log(y, x)", v}, {"y = expOrigin", b}, {"v", c}, {"index", index}});
      // The nearest representative is not defined on the cut locus.
      if (room < 1000 * bench.eps) continue;
      const Vector z = m.errorVector(y, x);
      bench.equal("the error vector does not depend on the feature's representative", m.errorVector(y, x_i), z,
                  {{"log(y, x)", v}, {"y = expOrigin", b}, {"index", index}});
      bench.equal("a change of the base's representative turns the error vector by representativeJacobian",
                  m.errorVector(y_i, x), product(K, z), {{"log(y, x)", v}, {"y = expOrigin", b}, {"index", index}});
      bench.equal("errorVector by the feature turns with its representative", product(m.errorByFeature(y, x_i), K),
                  m.errorByFeature(y, x), {{"log(y, x)", v}, {"y = expOrigin", b}, {"index", index}}, 4);
      bench.equal("errorVector by the base does not depend on the feature's representative", m.errorByBase(y, x_i),
                  m.errorByBase(y, x), {{"log(y, x)", v}, {"y = expOrigin", b}, {"index", index}}, 4);
    }
  });
}

}  // namespace liestat
