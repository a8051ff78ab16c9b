// The record of a manifold's operations (detail/contract_record.hpp): the only code of the contract that a manifold
// costs the compiler, one small function per operation.
#pragma once

#include <lie/detail/contract_record.hpp>
#include <lie/manifold.hpp>

#include <Eigen/Core>

#include <concepts>
#include <limits>
#include <optional>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

template <class D>
Eigen::MatrixXd contractMatrix(const Eigen::MatrixBase<D>& expression) {
  const auto& m = expression.eval();
  Eigen::MatrixXd wide(m.rows(), m.cols());
  for (Eigen::Index j = 0; j < m.cols(); ++j) {
    for (Eigen::Index i = 0; i < m.rows(); ++i) wide(i, j) = static_cast<double>(m.coeff(i, j));
  }
  return wide;
}
template <class D>
Eigen::VectorXd contractVector(const Eigen::MatrixBase<D>& expression) {
  const auto& v = expression.eval();
  Eigen::VectorXd wide(v.size());
  for (Eigen::Index i = 0; i < v.size(); ++i) wide[i] = static_cast<double>(v.coeff(i));
  return wide;
}
/// A vector or matrix of fixed size from one of run-time size.
template <class Fixed, class Wide>
Fixed contractNarrow(const Wide& wide) {
  Fixed m;
  for (Eigen::Index j = 0; j < m.cols(); ++j) {
    for (Eigen::Index i = 0; i < m.rows(); ++i) m(i, j) = static_cast<typename Fixed::Scalar>(wide(i, j));
  }
  return m;
}

template <LieGroup G>
ManifoldOperations::Group groupOperations() {
  using Vector = ManifoldOperations::Vector;
  using Matrix = ManifoldOperations::Matrix;
  using Element = ManifoldOperations::Element;
  using Tangent = typename G::Tangent;
  // With a plus, a lambda is a pointer to a function, and std::function is instantiated for each signature only.
  ManifoldOperations::Group g;
  g.dimension = G::DoF;
  g.identity = +[] {
    if constexpr (std::default_initializable<G>) {
      return Element::of(G());
    } else {
      return Element::of(G(G::exp(Tangent::Zero())));
    }
  };
  g.product = +[](const Element& a, const Element& b) { return Element::of<G>(a.as<G>() * b.as<G>()); };
  g.inverse = +[](const Element& a) { return Element::of<G>(a.as<G>().inverse()); };
  g.exp = +[](const Vector& v) { return Element::of<G>(G::exp(contractNarrow<Tangent>(v))); };
  g.log = +[](const Element& a) { return contractVector(a.as<G>().log()); };
  g.Adj = +[](const Element& a) { return contractMatrix(a.as<G>().Adj()); };
  g.leftJacobian = +[](const Vector& v) { return contractMatrix(G::leftJacobian(contractNarrow<Tangent>(v))); };
  g.leftJacobianInverse =
      +[](const Vector& v) { return contractMatrix(G::leftJacobianInverse(contractNarrow<Tangent>(v))); };
  g.rightJacobian = +[](const Vector& v) { return contractMatrix(G::rightJacobian(contractNarrow<Tangent>(v))); };
  g.rightJacobianInverse =
      +[](const Vector& v) { return contractMatrix(G::rightJacobianInverse(contractNarrow<Tangent>(v))); };
  if constexpr (requires(const Tangent& v) { G::ad(v); }) {
    g.ad = +[](const Vector& v) { return contractMatrix(G::ad(contractNarrow<Tangent>(v))); };
  }
  if constexpr (requires(const G& f) { f.matrix(); }) {
    g.matrix = +[](const Element& a) { return contractMatrix(a.as<G>().matrix()); };
  }
  if constexpr (requires(const G& f, const Tangent& v) {
                  G::hat(v);
                  G::vee(f.matrix());
                }) {
    using Square = typename std::remove_cvref_t<decltype(G::hat(std::declval<const Tangent&>()))>::PlainObject;
    g.hat = +[](const Vector& v) { return contractMatrix(G::hat(contractNarrow<Tangent>(v))); };
    g.vee = +[](const Matrix& m) { return contractVector(G::vee(contractNarrow<Square>(m))); };
  }
  return g;
}

/// The operations that M's traits offer to statistics.
template <Homogeneous M>
ManifoldOperations::Statistics statisticsOperationsOf() {
  using T = ManifoldTraits<M>;
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  ManifoldOperations::Statistics s;
  s.compact_factor = compactFactor<M>();
  if constexpr (compactFactor<M>() != CompactFactor::none && compactFactor<M>() != CompactFactor::unknown) {
    s.compact_begin = T::compact_begin;
    s.compactCoordinates = +[](const Point& x) { return contractVector(T::compactCoordinates(x.as<M>())); };
  }
  if constexpr (HasChordalMoments<M>) {
    s.chordalMean = +[](const std::vector<Point>& points, const Vector& weights) {
      typename T::ChordalMoments sums;
      for (std::size_t i = 0; i < points.size(); ++i) {
        sums.add(points[i].as<M>(), static_cast<typename T::Scalar>(weights[static_cast<Eigen::Index>(i)]));
      }
      const std::optional<M> mean = sums.mean();
      return mean ? std::vector<Point>{Point::of<M>(*mean)} : std::vector<Point>{};
    };
  }
  if constexpr (HasRotationParameters<M>) {
    s.parameters = +[](const Point& x) {
      const auto* p = T::parameters(x.as<M>());
      Vector v(T::DoF == 3 ? 4 : 7);
      for (Eigen::Index i = 0; i < v.size(); ++i) v[i] = static_cast<double>(p[i]);
      return v;
    };
  }
  if constexpr (HasTangentParts<M>) {
    for (const TangentBlock& b : T::tangent_parts) s.tangent_parts.push_back(b);
  }
  if constexpr (HasMetricTwin<M>) {
    s.throughMetricTwin = +[](const Point& x) { return Point::of<M>(T::fromMetricTwin(T::metricTwin(x.as<M>()))); };
  }
  if constexpr (Factored<M>) {
    using Factors = std::decay_t<decltype(T::factors(std::declval<const M&>()))>;
    s.throughFactors = +[](const Point& x) { return Point::of<M>(T::fromFactors(T::factors(x.as<M>()))); };
    std::apply(
        [&](const auto&... f) { (s.factor_sizes.push_back(ManifoldTraits<std::decay_t<decltype(f)>>::DoF), ...); },
        Factors(T::factors(M(T::origin()))));
    if constexpr (Metric<M>) {
      s.factorDistances = +[](const Point& x, const Point& y) {
        return std::apply(
            [&](const auto&... a) {
              return std::apply(
                  [&](const auto&... b) {
                    Vector d(sizeof...(a));
                    Eigen::Index i = 0;
                    ((d[i++] = static_cast<double>(liestat::distance(a, b))), ...);
                    return d;
                  },
                  Factors(T::factors(y.as<M>())));
            },
            Factors(T::factors(x.as<M>())));
      };
    }
  }
  return s;
}

}  // namespace detail

/// The record of M's operations.
template <Homogeneous M>
ManifoldOperations operationsOf() {
  using detail::contractMatrix, detail::contractNarrow, detail::contractVector;
  using T = ManifoldTraits<M>;
  using G = typename T::Group;
  using Tangent = typename T::Tangent;
  using Square = typename T::Square;
  using Vector = ManifoldOperations::Vector;
  using Point = ManifoldOperations::Point;
  using Element = ManifoldOperations::Element;

  ManifoldOperations m;
  m.group = detail::groupOperations<G>();
  m.dimension = T::DoF;
  m.epsilon = static_cast<double>(std::numeric_limits<typename T::Scalar>::epsilon());
  m.rounded = +[](const Vector& v) {
    Vector rounded(v.size());
    for (Eigen::Index i = 0; i < v.size(); ++i) {
      rounded[i] = static_cast<double>(static_cast<typename T::Scalar>(v[i]));
    }
    return rounded;
  };

  m.origin = +[] { return Point::of<M>(T::origin()); };
  m.act = +[](const Element& f, const Point& x) { return Point::of<M>(T::act(f.as<G>(), x.as<M>())); };
  m.placement = +[](const Point& x) { return Element::of<G>(T::placement(x.as<M>())); };
  m.expOrigin = +[](const Vector& v) { return Point::of<M>(T::expOrigin(contractNarrow<Tangent>(v))); };
  m.logOrigin = +[](const Point& x) { return contractVector(T::logOrigin(x.as<M>())); };
  m.dexpOrigin = +[](const Vector& v) { return contractMatrix(T::dexpOrigin(contractNarrow<Tangent>(v))); };
  m.dlogOrigin = +[](const Point& x) { return contractMatrix(T::dlogOrigin(x.as<M>())); };
  m.isotropy = +[](const Element& f, const Point& x) { return contractMatrix(T::isotropy(f.as<G>(), x.as<M>())); };
  m.originProjection = +[] { return contractMatrix(T::originProjection()); };
  m.placementJacobian = +[](const Point& x) { return contractMatrix(T::placementJacobian(x.as<M>())); };
  m.isPlacementSmooth = +[](const Point& x) { return static_cast<bool>(T::isPlacementSmooth(x.as<M>())); };

  m.exp = +[](const Point& x, const Vector& v) {
    return Point::of<M>(liestat::exp(x.as<M>(), contractNarrow<Tangent>(v)));
  };
  m.log = +[](const Point& x, const Point& y) { return contractVector(liestat::log(x.as<M>(), y.as<M>())); };
  m.actionFeatureJacobian = +[](const Element& f, const Point& x) {
    return contractMatrix(liestat::actionFeatureJacobian(f.as<G>(), x.as<M>()));
  };
  m.actionTransformationJacobian = +[](const Element& f, const Point& x) {
    return contractMatrix(liestat::actionTransformationJacobian(f.as<G>(), x.as<M>()));
  };
  m.principalChartJacobian = +[](const Point& x) { return contractMatrix(liestat::principalChartJacobian(x.as<M>())); };
  m.logBaseJacobian = +[](const Point& p) {
    return contractMatrix(liestat::logBaseJacobian(p.as<M>(), Square(T::dlogOrigin(p.as<M>()))));
  };
  m.frameTransport =
      +[](const Point& x, const Point& y) { return contractMatrix(liestat::frameTransport(x.as<M>(), y.as<M>())); };
  m.errorVector =
      +[](const Point& y, const Point& x) { return contractVector(liestat::errorVector(y.as<M>(), x.as<M>()).z); };
  m.errorByFeature = +[](const Point& y, const Point& x) {
    return contractMatrix(liestat::errorVector(y.as<M>(), x.as<M>()).by_feature);
  };
  m.errorByBase = +[](const Point& y, const Point& x) {
    return contractMatrix(liestat::errorVector(y.as<M>(), x.as<M>()).by_base);
  };

  if constexpr (Metric<M>) {
    m.distance =
        +[](const Point& x, const Point& y) { return static_cast<double>(liestat::distance(x.as<M>(), y.as<M>())); };
    m.metricWeights = +[] { return contractVector(Tangent(T::metricWeights())); };
    m.injectivityRadius = +[] { return static_cast<double>(T::injectivityRadius()); };
    m.hessianHalfSquaredDistance = +[](const Vector& z) {
      return contractMatrix(Square(T::hessianHalfSquaredDistance(contractNarrow<Tangent>(z))));
    };
  }
  if constexpr (Quotient<M>) {
    for (const auto i : T::representatives) m.representatives.push_back(static_cast<int>(i));
    m.representative = +[](const Point& x, const int& i) { return Point::of<M>(T::representative(x.as<M>(), i)); };
    m.representativeJacobian = +[](const int& i) { return contractMatrix(Square(T::representativeJacobian(i))); };
    m.representativeGap =
        +[](const Point& x) { return static_cast<double>(T::nearestRepresentative(x.as<M>()).gap()); };
  }
  if constexpr (requires(const Tangent& z) {
                  T::dlogFeatureTransposed(z, z);
                  T::dlogBaseTransposed(z, z);
                }) {
    m.dlogFeatureTransposed = +[](const Vector& z, const Vector& a) {
      return contractMatrix(T::dlogFeatureTransposed(contractNarrow<Tangent>(z), contractNarrow<Tangent>(a)));
    };
    m.dlogBaseTransposed = +[](const Vector& z, const Vector& a) {
      return contractMatrix(T::dlogBaseTransposed(contractNarrow<Tangent>(z), contractNarrow<Tangent>(a)));
    };
  }
  m.statistics = detail::statisticsOperationsOf<M>();
  return m;
}

}  // namespace liestat
