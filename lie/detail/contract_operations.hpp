// The record of a manifold's operations on which the contract's checks work. The checks are ordinary functions of this
// record, compiled once for all manifolds; the only code that a manifold costs the compiler is the list below, one
// small function per operation.
//
// Points and group elements are opaque handles. Tangent vectors and matrices are those of the manifold's scalar,
// carried in double: a float is a double, so nothing is lost on the way out, and `rounded` tells what is lost on the
// way in.
#pragma once

#include <lie/manifold.hpp>

#include <Eigen/Core>

#include <concepts>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

/// A value of a type that its holder does not know. Tag keeps points and group elements apart.
template <class Tag>
class ContractHandle {
 public:
  template <class T>
  static ContractHandle of(const T& value) {
    ContractHandle handle;
    handle.value_ = std::shared_ptr<const void>(new T(value));
    return handle;
  }
  template <class T>
  const T& as() const {
    return *static_cast<const T*>(value_.get());
  }

 private:
  std::shared_ptr<const void> value_;
};

}  // namespace detail

/// The operations of a manifold M and of the group that acts on it, without their types. What M does not have is empty.
struct ManifoldOperations {
  using Vector = Eigen::VectorXd;
  using Matrix = Eigen::MatrixXd;
  using Point = detail::ContractHandle<struct PointTag>;
  using Element = detail::ContractHandle<struct ElementTag>;
  template <class Result, class... Arguments>
  using Function = std::function<Result(const Arguments&...)>;

  /// The group that acts on M.
  struct Group {
    int dimension = 0;
    Function<Element> identity;
    Function<Element, Element, Element> product;
    Function<Element, Element> inverse;
    Function<Element, Vector> exp;
    Function<Vector, Element> log;
    Function<Matrix, Element> Adj;
    Function<Matrix, Vector> leftJacobian, leftJacobianInverse, rightJacobian, rightJacobianInverse;
    // Optional.
    Function<Matrix, Vector> ad;
    Function<Matrix, Element> matrix;
    Function<Matrix, Vector> hat;
    Function<Vector, Matrix> vee;
  } group;

  int dimension = 0;
  double epsilon = 0;                ///< of the scalar
  Function<Vector, Vector> rounded;  ///< to the nearest numbers of the scalar

  // Homogeneous.
  Function<Point> origin;
  Function<Point, Element, Point> act;
  Function<Element, Point> placement;
  Function<Point, Vector> expOrigin;
  Function<Vector, Point> logOrigin;
  Function<Matrix, Vector> dexpOrigin;
  Function<Matrix, Point> dlogOrigin;
  Function<Matrix, Element, Point> isotropy;
  Function<Matrix> originProjection;
  Function<Matrix, Point> placementJacobian;
  Function<bool, Point> isPlacementSmooth;

  // What lie/manifold.hpp makes of these. The base's Jacobian takes dlogOrigin(p) itself.
  Function<Point, Point, Vector> exp;
  Function<Vector, Point, Point> log;
  Function<Matrix, Element, Point> actionFeatureJacobian, actionTransformationJacobian;
  Function<Matrix, Point> principalChartJacobian, logBaseJacobian;
  Function<Matrix, Point, Point> frameTransport;
  Function<Vector, Point, Point> errorVector;
  Function<Matrix, Point, Point> errorByFeature, errorByBase;

  // Metric.
  Function<double, Point, Point> distance;
  Function<Vector> metricWeights;
  Function<double> injectivityRadius;
  Function<Matrix, Vector> hessianHalfSquaredDistance;

  // Quotient.
  std::vector<int> representatives;
  Function<Point, Point, int> representative;
  Function<Matrix, int> representativeJacobian;
  Function<double, Point> representativeGap;  ///< of nearestRepresentative

  // Optional: derivatives of dlogOrigin (see checkSecondDerivatives).
  Function<Matrix, Vector, Vector> dlogFeatureTransposed, dlogBaseTransposed;

  /// What the traits tell statistics; empty where they say nothing.
  struct Statistics {
    CompactFactor compact_factor = CompactFactor::unknown;
    int compact_begin = 0;
    Function<Vector, Point> compactCoordinates, parameters;
    Function<std::vector<Point>, std::vector<Point>, Vector> chordalMean;  ///< of weighted points; one or, if they
                                                                           ///< cancel, none
    std::vector<TangentBlock> tangent_parts;
    Function<Point, Point> throughMetricTwin, throughFactors;  ///< there and back
    std::vector<int> factor_sizes;
    Function<Vector, Point, Point> factorDistances;
  } statistics;
};

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

}  // namespace detail

namespace detail {

/// What M's traits tell statistics.
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
