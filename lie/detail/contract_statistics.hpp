// The contract's checks of what a manifold's traits tell statistics: the compact factor, the moments of an embedding,
// the parts of tangent vectors, a metric twin (lie/concepts.hpp). What the traits do not say is not checked.
#pragma once

#include <lie/detail/contract_inputs.hpp>

namespace liestat {
namespace detail {

/// The exponential of compact coordinates as the traits are to say it: of (rad) coordinates of a circle, a sphere or a
/// rotation.
inline Eigen::VectorXd compactExponential(CompactFactor factor, const Eigen::VectorXd& v) {
  const double angle = v.norm();
  const double half = factor == CompactFactor::rotation ? 0.5 * angle : angle;
  const Eigen::VectorXd direction = angle > 0 ? Eigen::VectorXd(v / angle) : Eigen::VectorXd(v);
  Eigen::VectorXd c(v.size() + 1);
  if (factor == CompactFactor::circle) {
    c << std::cos(v[0]), std::sin(v[0]);
  } else {
    c << std::sin(half) * direction, std::cos(half);
  }
  return c;
}

/// The angle between two unit vectors of compact coordinates, rad; quaternions of either sign.
inline double compactAngle(CompactFactor factor, const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  const double apart = (a - b).norm(), opposite = (a + b).norm();
  if (factor == CompactFactor::rotation) return 4 * std::atan2(std::min(apart, opposite), std::max(apart, opposite));
  return 2 * std::atan2(apart, opposite);
}

}  // namespace detail

/// The compact factor: a unit vector that the exponential and the metric know as one.
inline void checkCompactFactor(const ManifoldOperations& m, ContractReport& report,
                               const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  const auto& s = m.statistics;
  if (!s.compactCoordinates || !m.distance) return;
  constexpr double infinity = std::numeric_limits<double>::infinity();
  detail::ContractBench bench(m, report, options);
  const int size = s.compact_factor == CompactFactor::circle ? 1 : s.compact_factor == CompactFactor::sphere ? 2 : 3;
  const auto coordinates = static_cast<int>(s.compactCoordinates(m.origin()).size());
  // A circle's angle is a unit vector of two numbers, a direction's of three, a rotation's is a quaternion.
  const bool fits = coordinates == size + 1 && s.compact_begin >= 0 && s.compact_begin + size <= m.dimension;
  bench.exact("compact_factor says how many numbers compactCoordinates has", fits ? 0 : infinity, {});
  if (!fits) return;
  const auto angle = [&](const Vector& a, const Vector& b) { return detail::compactAngle(s.compact_factor, a, b); };
  // On a quotient the nearest representative counts.
  const auto nearest = [&](const Point& x, const Vector& to) {
    double least = angle(s.compactCoordinates(x), to);
    for (const int i : m.representatives)
      least = std::min(least, angle(s.compactCoordinates(m.representative(x, i)), to));
    return least;
  };
  bench.overAll([&](const Vector& v) {
    const Vector b = bench.generic();
    const Point y = m.expOrigin(b), x = m.exp(y, v), at_v = m.expOrigin(v);
    const Vector c = s.compactCoordinates(x);
    bench.exact("compactCoordinates is a unit vector", std::abs(c.norm() - 1), {{"v", v}, {"y = expOrigin", b}});
    bench.exact("compactCoordinates(expOrigin(v)) is the exponential of v's compact coordinates",
                nearest(at_v, detail::compactExponential(s.compact_factor, v.segment(s.compact_begin, size))),
                {{"v", v}}, 4);
    const Vector z = m.log(y, x);
    const double between = nearest(x, s.compactCoordinates(y));
    bench.exact("the angle of compactCoordinates is that of the logarithm",
                std::abs(between - z.segment(s.compact_begin, size).norm()), {{"v", v}, {"y = expOrigin", b}}, 4);
    Vector rest = z;
    rest.segment(s.compact_begin, size).setZero();
    const double flat = (m.metricWeights().array() * rest.array() * rest.array()).sum();
    const double squared = std::pow(m.distance(y, x), 2);
    bench.exact("distance² is the compact angle's square and a flat rest", std::abs(squared - between * between - flat),
                {{"v", v}, {"y = expOrigin", b}}, 4 * (1 + squared));
  });
}

/// The moments of an embedding: the mean of one feature is the feature, and motions move the mean of several.
inline void checkChordalMoments(const ManifoldOperations& m, ContractReport& report,
                                const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  using Element = ManifoldOperations::Element;
  const auto& s = m.statistics;
  if (!s.chordalMean) return;
  detail::ContractBench bench(m, report, options);
  const auto gap = [&](const std::vector<Point>& mean, const Point& x) {
    return mean.empty() ? std::numeric_limits<double>::infinity() : m.log(x, mean.front()).norm();
  };
  bench.overAll([&](const Vector& v) {
    const Vector a = bench.genericGroup(), b = bench.generic(), c = bench.generic();
    const Point x = m.expOrigin(v), y = m.expOrigin(b);
    bench.exact("the chordal mean of one feature is that feature", gap(s.chordalMean({x}, Vector::Constant(1, 2.5)), x),
                {{"x = expOrigin", v}}, 8);
    const Element f = m.group.exp(a);
    std::vector<Point> points, moved;
    for (const double k : {-0.1, 0.05, 0.2}) points.push_back(m.exp(y, k * c));
    for (const Point& p : points) moved.push_back(m.act(f, p));
    const Vector weights = Vector::LinSpaced(3, 1, 3);
    const std::vector<Point> mean = s.chordalMean(points, weights);
    bench.exact("the chordal mean moves with the features",
                mean.empty() ? std::numeric_limits<double>::infinity()
                             : gap(s.chordalMean(moved, weights), m.act(f, mean.front())),
                {{"f = Exp", a}, {"y = expOrigin", b}, {"v", c}}, 16 * bench.condition(y));
  });
}

/// Parameters in memory: the quaternion of the compact factor and the position.
inline void checkRotationParameters(const ManifoldOperations& m, ContractReport& report,
                                    const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  const auto& s = m.statistics;
  if (!s.parameters) return;
  detail::ContractBench bench(m, report, options);
  bench.overAll([&](const Vector& v) {
    const Point x = m.expOrigin(v);
    const Vector p = s.parameters(x), c = s.compactCoordinates(x), q = p.head(4);
    bench.exact("parameters begin with the quaternion of compactCoordinates", std::min((q - c).norm(), (q + c).norm()),
                {{"x = expOrigin", v}});
    if (p.size() > 4) {
      bench.equal("parameters end with the position", p.tail(3), Vector(m.logOrigin(x).head(3)), {{"x = expOrigin", v}},
                  4);
    }
  });
}

/// The parts of tangent vectors cover it one after the other, and angles are those coordinates that come round.
inline void checkTangentParts(const ManifoldOperations& m, ContractReport& report, const ContractOptions& = {}) {
  using Vector = ManifoldOperations::Vector;
  const auto& s = m.statistics;
  if (s.tangent_parts.empty()) return;
  constexpr double turn = 2 * static_cast<double>(EIGEN_PI);
  int next = 0;
  for (const TangentBlock& b : s.tangent_parts) {
    const Vector input = Vector::Constant(1, b.begin);
    const double gap = b.size > 0 ? std::abs(b.begin - next) : 1;
    report.record("tangent_parts follow each other", gap, 0, {{"begin", input}});
    next = b.begin + b.size;
    for (int i = b.begin; i < std::min(next, m.dimension); ++i) {
      const Vector e = turn * Vector::Unit(m.dimension, i);
      const bool comes_round = m.logOrigin(m.expOrigin(e)).norm() < 1e-3;
      report.record("tangent_parts name the angles", comes_round == isAngular(b.part) ? 0 : 1, 0, {{"v", e}});
    }
  }
  report.record("tangent_parts cover the tangent vector", std::abs(next - m.dimension), 0,
                {{"dimension", Vector::Constant(1, m.dimension)}});
}

/// A metric twin goes there and back, and a product comes apart and together again.
inline void checkTwinAndFactors(const ManifoldOperations& m, ContractReport& report,
                                const ContractOptions& options = {}) {
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  const auto& s = m.statistics;
  if (!s.throughMetricTwin && !s.throughFactors) return;
  detail::ContractBench bench(m, report, options);
  bench.overAll([&](const Vector& v) {
    const Vector b = bench.generic();
    const Point y = m.expOrigin(b), x = m.exp(y, v);
    if (s.throughMetricTwin) {
      bench.exact("fromMetricTwin(metricTwin(x)) == x", m.log(x, s.throughMetricTwin(x)).norm(),
                  {{"v", v}, {"y = expOrigin", b}}, 4);
    }
    if (s.throughFactors) {
      bench.exact("fromFactors(factors(x)) == x", m.log(x, s.throughFactors(x)).norm(),
                  {{"v", v}, {"y = expOrigin", b}}, 4);
    }
    if (s.factorDistances) {
      // The factors' coordinates stand one after the other.
      const Vector z = m.log(y, x), distances = s.factorDistances(y, x), weights = m.metricWeights();
      Eigen::Index begin = 0;
      for (std::size_t i = 0; i < s.factor_sizes.size(); ++i) {
        const Eigen::Index n = s.factor_sizes[i];
        const double squared = (weights.segment(begin, n).array() * z.segment(begin, n).array().square()).sum();
        const double d = distances[static_cast<Eigen::Index>(i)];
        bench.exact("tangent vectors are those of the factors in their order", std::abs(std::sqrt(squared) - d),
                    {{"v", v}, {"y = expOrigin", b}}, 4);
        begin += n;
      }
    }
  });
}

/// All of these checks.
inline void checkStatisticsTraits(const ManifoldOperations& m, ContractReport& report,
                                  const ContractOptions& options = {}) {
  for (const auto check :
       {checkCompactFactor, checkChordalMoments, checkRotationParameters, checkTangentParts, checkTwinAndFactors}) {
    check(m, report, options);
  }
}

}  // namespace liestat
