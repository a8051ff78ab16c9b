// Operations derived, once for every manifold, from the atomic ones of lie/concepts.hpp: exp, log, distance and their
// Jacobians at any point, and the traits of a group that acts on itself.
//
// Tangent vectors at x are coordinates in the frame that placement(x) carries there (for a group: body frame,
// x·Exp(v)).
#pragma once

#include <lie/concepts.hpp>

#include <cmath>
#include <concepts>
#include <span>
#include <type_traits>

namespace liestat {

/// Tangent vector and square matrix of a manifold's dimension.
template <Homogeneous M>
using TangentOf = typename ManifoldTraits<M>::Tangent;
template <Homogeneous M>
using SquareOf = typename ManifoldTraits<M>::Square;
template <Homogeneous M>
using ScalarOf = typename ManifoldTraits<M>::Scalar;

/// The point of a manifold that a value of another type stands for: `type` and `from(value)`. A view (Eigen::Map) or an
/// expression (a column of a matrix) stands for the owning type, an Eigen::Quaternion for an SO3 (lie/so3.hpp).
/// Estimators take ranges of such values as they take ranges of points. Specialise it for a type of your own that
/// converts to a manifold.
template <class V>
struct PointTraits {};

template <class V>
  requires requires { typename ManifoldTraits<V>::Group; }
struct PointTraits<V> {
  using type = V;
  static const V& from(const V& point) { return point; }
};

/// Expressions of fixed-size column vectors: the vector.
template <class V>
  requires(std::derived_from<V, Eigen::MatrixBase<V>> && !requires { typename ManifoldTraits<V>::Group; } &&
           V::ColsAtCompileTime == 1 && V::RowsAtCompileTime > 0)
struct PointTraits<V> {
  using type = Eigen::Matrix<typename V::Scalar, V::RowsAtCompileTime, 1>;
  static type from(const V& expression) { return expression; }
};

/// The owning type of the point that a V, reference or not, stands for.
template <class V>
using PointOf = typename PointTraits<std::remove_cvref_t<V>>::type;

namespace detail {

/// log |det ∂exp| at a tangent vector, the density of the invariant volume in the exponential chart, with derivatives.
template <class S, int N>
struct VolumeElement {
  S value = S(0);
  Eigen::Matrix<S, N, 1> gradient = Eigen::Matrix<S, N, 1>::Zero();
  Eigen::Matrix<S, N, N> hessian = Eigen::Matrix<S, N, N>::Zero();
};

}  // namespace detail

/// Base of every ManifoldTraits specialisation: names, and the defaults of a manifold whose isotropy is trivial (a
/// placement that is smooth everywhere, tangent coordinates equal to those of the group).
template <class M, class Group_>
struct TrivialIsotropy {
  using Group = Group_;
  using Scalar = typename Group::Scalar;
  static constexpr int DoF = Group::DoF;
  using Tangent = Eigen::Matrix<Scalar, DoF, 1>;
  using Square = Eigen::Matrix<Scalar, DoF, DoF>;
  /// isotropy, originProjection and placementJacobian are the identity. What follows from them below leaves these
  /// factors out, so a specialisation that defines one of the three again says false here.
  static constexpr bool trivial_isotropy = true;

  static M origin() { return M(); }
  static Square isotropy(const Group&, const M&) { return Square::Identity(); }
  static Square originProjection() { return Square::Identity(); }
  static Square placementJacobian(const M&) { return Square::Identity(); }
  static bool isPlacementSmooth(const M&) { return true; }
};

/// Traits of a group that acts on itself from the left, with its group exponential as retraction.
template <class G>
struct GroupManifold : TrivialIsotropy<G, G> {
  /// log(x, y) == -log(y, x), so a covariance attached to the measured or to the estimated feature says the same.
  static constexpr bool covariance_models_coincide = true;

  using typename TrivialIsotropy<G, G>::Tangent;
  using typename TrivialIsotropy<G, G>::Square;

  static G act(const G& f, const G& x) { return f * x; }
  static G placement(const G& x) { return x; }
  static G expOrigin(const Tangent& v) { return G::exp(v); }
  static Tangent logOrigin(const G& x) { return x.log(); }
  static Square dexpOrigin(const Tangent& v) { return G::rightJacobian(v); }
  static Square dlogOrigin(const G& x) { return G::rightJacobianInverse(x.log()); }
};

namespace detail {

template <class M>
concept HasTrivialIsotropy = requires {
  requires ManifoldTraits<M>::trivial_isotropy;
};

}  // namespace detail

/// The indices of the representatives of a quotient feature: those of its type, or its own if features differ in them.
template <Quotient M>
std::span<const int> representativesOf(const M& x) {
  using T = ManifoldTraits<M>;
  if constexpr (requires { T::representativesOf(x); }) {
    return T::representativesOf(x);
  } else {
    return T::representatives;
  }
}

/// The injectivity radius at x: that of the type, but where its points differ.
template <Metric M>
auto injectivityRadiusAt(const M& x) {
  using T = ManifoldTraits<M>;
  if constexpr (requires { T::injectivityRadius(x); }) {
    return T::injectivityRadius(x);
  } else {
    return T::injectivityRadius();
  }
}

/// f⋆x
template <Homogeneous M>
M act(const typename ManifoldTraits<M>::Group& f, const M& x) {
  return ManifoldTraits<M>::act(f, x);
}

/// The point reached from x by the tangent vector v: placement(x)⋆expOrigin(v) (Pennec 1998, section 2.2). A type whose
/// points carry more than their coordinates, which the origin cannot know, says exp(x, v) in its traits.
template <Homogeneous M>
M exp(const M& x, const TangentOf<M>& v) {
  using T = ManifoldTraits<M>;
  if constexpr (requires { T::exp(x, v); }) {
    return T::exp(x, v);
  } else {
    return T::act(T::placement(x), T::expOrigin(v));
  }
}

/// y in the frame of x: placement(x)⁻¹⋆y.
template <Homogeneous M>
M between(const M& x, const M& y) {
  using T = ManifoldTraits<M>;
  return T::act(T::placement(x).inverse(), y);
}

/// The tangent vector at x that leads to y: exp(x, log(x, y)) == y. On the cut locus a fixed choice is made.
template <Homogeneous M>
TangentOf<M> log(const M& x, const M& y) {
  return ManifoldTraits<M>::logOrigin(between(x, y));
}

/// Derivative of f⋆x with respect to x, local frames at x and f⋆x; exact.
template <Homogeneous M>
SquareOf<M> actionFeatureJacobian(const typename ManifoldTraits<M>::Group& f, const M& x) {
  return ManifoldTraits<M>::isotropy(f, x);
}

/// Derivative of f⋆x with respect to f ← f·Exp(d), local frame at f⋆x, DoF × Group::DoF; exact.
template <Homogeneous M>
auto actionTransformationJacobian(const typename ManifoldTraits<M>::Group& f, const M& x) {
  using T = ManifoldTraits<M>;
  if constexpr (detail::HasTrivialIsotropy<M>) {
    return SquareOf<M>(T::placement(x).inverse().Adj());
  } else {
    const auto projected = (T::isotropy(f, x) * T::originProjection()).eval();
    return (projected * T::placement(x).inverse().Adj()).eval();
  }
}

/// Error vector z = log(y, x) with its exact derivatives: ∂z/∂x for x ← exp(x, ξ), ∂z/∂y for y ← exp(y, ω) (frames
/// carried in parallel), D and L of docs/theory/means.md, section 2.
template <Homogeneous M>
struct ErrorVector {
  TangentOf<M> z;
  SquareOf<M> by_feature, by_base;
};

/// The transformation that carries the origin, and its frame in parallel, along the exponential to p. The placement
/// does that for the manifolds of this library; where another was chosen, the traits say transvection(p) and
/// transvectionJacobian(), its derivative at the origin, besides.
template <Homogeneous M>
typename ManifoldTraits<M>::Group transvection(const M& p) {
  using T = ManifoldTraits<M>;
  if constexpr (requires { T::transvection(p); }) {
    return T::transvection(p);
  } else {
    return T::placement(p);
  }
}

/// Derivative of logOrigin(transvection(exp(o, ω))⁻¹⋆p) with respect to ω at zero, from dlogOrigin(p).
template <Homogeneous M>
SquareOf<M> logBaseJacobian(const M& p, const SquareOf<M>& dlog) {
  using T = ManifoldTraits<M>;
  if constexpr (detail::HasTrivialIsotropy<M>) {
    return -(dlog * T::placement(p).inverse().Adj());
  } else {
    const auto projected = (dlog * T::originProjection()).eval();
    const auto by_group = (projected * T::placement(p).inverse().Adj()).eval();
    if constexpr (requires { T::transvectionJacobian(); }) {
      return -(by_group * T::transvectionJacobian());
    } else {
      return -(by_group * T::placementJacobian(T::origin()));
    }
  }
}

/// z = log(y, x) with its Jacobians.
template <Homogeneous M>
ErrorVector<M> errorVector(const M& y, const M& x) {
  using T = ManifoldTraits<M>;
  const typename T::Group f = T::placement(y).inverse();
  const M p = T::act(f, x);
  const SquareOf<M> dlog = T::dlogOrigin(p);
  if constexpr (detail::HasTrivialIsotropy<M>) {
    return {T::logOrigin(p), dlog, logBaseJacobian(p, dlog)};
  } else {
    return {T::logOrigin(p), dlog * T::isotropy(f, x), logBaseJacobian(p, dlog)};
  }
}

/// J(f_x) of the report: derivative of the principal chart, logOrigin(exp(x, v)), with respect to v at zero; exact.
/// Σ_chart = J Σ Jᵀ converts a covariance of the local frame to the principal chart.
template <Homogeneous M>
SquareOf<M> principalChartJacobian(const M& x) {
  return ManifoldTraits<M>::dlogOrigin(x);
}

/// Geodesic distance (rad, or metres scaled by the metric weights of the manifold). For a Metric manifold only: SE3,
/// SE_2(3) and Sim3 have no invariant metric, use their group logarithm or MAHA instead.
template <class M>
ScalarOf<M> distance(const M& x, const M& y) {
  static_assert(Metric<M>,
                "distance needs an invariant Riemannian metric; this type has none. Use Frame3 for poses, or "
                "the group's own log and groupMean.");
  using std::sqrt;
  const TangentOf<M> z = log(x, y);
  return sqrt(z.dot(ManifoldTraits<M>::metricWeights().cwiseProduct(z)));
}

/// The point at fraction s of the way from x to y along exp(x, ·): x at 0, y at 1.
template <Homogeneous M>
M interpolate(const M& x, const M& y, const ScalarOf<M>& s) {
  return exp(x, TangentOf<M>(s * log(x, y)));
}

/// How the frame at x, carried to y by the transformation that moves x to y along exp, differs from the frame of
/// placement(y): tangent coordinates v at x become frameTransport(x, y)·v at y. Identity where the isotropy is trivial;
/// parallel transport on the sphere.
template <Homogeneous M>
SquareOf<M> frameTransport(const M& x, const M& y) {
  using T = ManifoldTraits<M>;
  if constexpr (detail::HasTrivialIsotropy<M>) {
    return SquareOf<M>::Identity();
  } else {
    const M p = between(x, y);
    // placement(x)·transvection(p) carries the origin to y along the exponential; its frame differs from
    // placement(y)'s by an isotropy element.
    SquareOf<M> turn = T::isotropy(T::placement(x), p);
    if constexpr (requires { T::transvection(p); }) {
      return turn * T::isotropy(T::transvection(p), T::origin());
    } else {
      return turn;
    }
  }
}

}  // namespace liestat
