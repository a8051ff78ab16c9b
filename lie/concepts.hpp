// The contracts on which the library is built: LieGroup, Homogeneous, Metric.
//
// Pennec 1998, section 2.2: the action of a transformation group with its Jacobians and the placement function with its
// Jacobian are the only atomic operations; everything else follows from them once, for every type of feature.
//
// Invariants of a Homogeneous manifold M with traits T = ManifoldTraits<M> (checked by lie/testing.hpp):
//   1. act(placement(x), origin()) == x, and placement(origin()) is the identity
//   2. act(f, act(g, x)) == act(f * g, x), act(identity, x) == x
//   3. logOrigin(expOrigin(v)) == v inside the injectivity domain; expOrigin(logOrigin(x)) == x everywhere
//   4. isotropy(f, x) is the action of placement(f x)⁻¹ f placement(x) on the tangent space of the origin
//   5. placement(x·exp(v)) == placement(x)·Exp(placementJacobian(x) v + O(v²)) wherever isPlacementSmooth(x)
//   6. logOrigin(p·exp(v)) == logOrigin(p) + dlogOrigin(p) v + O(v²); dexpOrigin is its inverse
//   7. Exp(d) acts on the origin as exp(originProjection() d + O(d²))
// and of a Metric manifold, in addition:
//   8. the distance is invariant: distance(f x, f y) == distance(x, y), symmetric, and satisfies the triangle
//   inequality
//   9. hessianHalfSquaredDistance(z) is the Hessian of ½ d²(·, x) at y, z = log(y, x), along geodesics
// and of a Quotient:
//  10. nothing depends on the representative: representative(x, i), i in representatives, is the same feature, tangent
//      vectors v at x are representativeJacobian(i) v there; logOrigin uses the nearest representative
// Tangent vectors at x are expressed in the image of the origin's frame under placement(x).
// If the isotropy group is not trivial and placement(expOrigin(v)) does not parallel-transport the origin's frame, the
// traits provide transvection(p), which does, and transvectionJacobian(), its derivative at the origin.
#pragma once

#include <lie/detail/finite_math.hpp>

#include <Eigen/Core>

#include <concepts>
#include <optional>

namespace liestat {

/// The operations that make M a manifold, as static members. Types of the library specialise it in their own header; a
/// user's type becomes a manifold by a specialisation of ManifoldTraits, without changes to the type. Undefined in
/// general.
template <class M>
struct ManifoldTraits;

/// A matrix Lie group: product, inverse, exponential map and its Jacobians. Perturbations are on the right.
template <class G>
concept LieGroup = requires(const G& a, const G& b, const typename G::Tangent& v) {
  typename G::Scalar;
  { G::DoF } -> std::convertible_to<int>;
  { G::num_parameters } -> std::convertible_to<int>;
  { a* b } -> std::convertible_to<G>;
  { a.inverse() } -> std::convertible_to<G>;
  { G::exp(v) } -> std::convertible_to<G>;
  { a.log() } -> std::convertible_to<typename G::Tangent>;
  { a.Adj() } -> std::convertible_to<Eigen::Matrix<typename G::Scalar, G::DoF, G::DoF>>;
  { G::leftJacobian(v) } -> std::convertible_to<Eigen::Matrix<typename G::Scalar, G::DoF, G::DoF>>;
  { G::leftJacobianInverse(v) } -> std::convertible_to<Eigen::Matrix<typename G::Scalar, G::DoF, G::DoF>>;
  { G::rightJacobian(v) } -> std::convertible_to<Eigen::Matrix<typename G::Scalar, G::DoF, G::DoF>>;
  { G::rightJacobianInverse(v) } -> std::convertible_to<Eigen::Matrix<typename G::Scalar, G::DoF, G::DoF>>;
};

/// A manifold on which a Lie group acts transitively, with a placement function and a retraction at the origin.
template <class M>
concept Homogeneous = LieGroup<typename ManifoldTraits<M>::Group> &&
    requires(const M& x, const typename ManifoldTraits<M>::Group& f, const typename ManifoldTraits<M>::Tangent& v) {
  typename ManifoldTraits<M>::Scalar;
  { ManifoldTraits<M>::DoF } -> std::convertible_to<int>;
  { ManifoldTraits<M>::origin() } -> std::convertible_to<M>;
  { ManifoldTraits<M>::act(f, x) } -> std::convertible_to<M>;
  { ManifoldTraits<M>::placement(x) } -> std::convertible_to<typename ManifoldTraits<M>::Group>;
  { ManifoldTraits<M>::expOrigin(v) } -> std::convertible_to<M>;
  { ManifoldTraits<M>::logOrigin(x) } -> std::convertible_to<typename ManifoldTraits<M>::Tangent>;
  { ManifoldTraits<M>::dexpOrigin(v) } -> std::convertible_to<typename ManifoldTraits<M>::Square>;
  { ManifoldTraits<M>::dlogOrigin(x) } -> std::convertible_to<typename ManifoldTraits<M>::Square>;
  { ManifoldTraits<M>::isotropy(f, x) } -> std::convertible_to<typename ManifoldTraits<M>::Square>;
  ManifoldTraits<M>::originProjection();
  ManifoldTraits<M>::placementJacobian(x);
  ManifoldTraits<M>::isPlacementSmooth(x);
};

/// A Homogeneous manifold whose retraction is the exponential map of an invariant Riemannian metric.
template <class M>
concept Metric = Homogeneous<M> && requires(const typename ManifoldTraits<M>::Tangent& z) {
  { ManifoldTraits<M>::hessianHalfSquaredDistance(z) } -> std::convertible_to<typename ManifoldTraits<M>::Square>;
  { ManifoldTraits<M>::metricWeights() } -> std::convertible_to<typename ManifoldTraits<M>::Tangent>;
  ManifoldTraits<M>::injectivityRadius();
  ManifoldTraits<M>::maxSectionalCurvature();
};

/// A Metric manifold that is a finite quotient: several representatives, of which logOrigin uses the nearest. Their
/// indices are `representatives`, or representativesOf(x) if points differ in them.
template <class M>
concept Quotient = Homogeneous<M> && requires(const M& x) {
  ManifoldTraits<M>::nearestRepresentative(x);
  { ManifoldTraits<M>::representative(x, 0) } -> std::convertible_to<M>;
  { ManifoldTraits<M>::representativeJacobian(0) } -> std::convertible_to<typename ManifoldTraits<M>::Square>;
};

/// A manifold whose traits decompose it: factors(x) is a std::tuple of features of other manifolds (a reference that it
/// returns is to a part of x), fromFactors(tuple) is its inverse, and if there is a metric the squared distance is the
/// sum of those of the factors, whose tangent coordinates are concatenated in the order of the tuple. Means, their
/// starts and their certificates of uniqueness are then those of the factors.
template <class M>
concept Factored = Homogeneous<M> && requires(const M& x) {
  { ManifoldTraits<M>::fromFactors(ManifoldTraits<M>::factors(x)) } -> std::convertible_to<M>;
};

/// The same with `frames_of_factors = true` in its traits: the frame at x consists of those of the factors at theirs,
/// as in products, whose placement is made of the factors'. Then the sums of a mean are those of the factors, too.
template <class M>
concept HasFramesOfFactors = Factored<M> && requires {
  requires ManifoldTraits<M>::frames_of_factors;
};

// Further properties of a manifold that statistics use. All of them are optional: without them means start at the best
// of several measurements, and the certificates of uniqueness are those that need distances alone. Statistics use these
// traits and never the members of a type or its layout in memory.

/// The compact space on which means of a manifold can fail to be unique.
enum class CompactFactor {
  none,      ///< the manifold is flat: a mean is always unique
  circle,    ///< SO(2)
  sphere,    ///< S²
  rotation,  ///< SO(3), or where the manifold is a Quotient, its quotient by a group of crystal_rotations
  unknown    ///< nothing is known: the default
};

/// A Metric manifold that is the product of one such space and a flat one: d² is the angle between compact parts,
/// squared, plus a squared Euclidean distance. Its traits define compact_factor, and unless that is none
///   compact_begin          where its coordinates (rad; 1 of the circle, 2 of the sphere, 3 of SO(3)) begin in the
///                          tangent vector; exp along them moves nothing else
///   compactCoordinates(x)  the compact part as a unit vector: (cos, sin); a point of the sphere, the origin being
///                          (0, 0, 1); the unit quaternion x y z w of either sign. Of expOrigin(v) it is the
///                          exponential of v's compact coordinates, and the action of the group turns it
template <class M>
concept HasCompactFactor = Homogeneous<M> && requires {
  { ManifoldTraits<M>::compact_factor } -> std::convertible_to<CompactFactor>;
};

namespace detail {

/// compact_factor, or unknown if the traits do not define it.
template <Homogeneous M>
constexpr CompactFactor compactFactor() {
  if constexpr (HasCompactFactor<M>) {
    static_assert(
        ManifoldTraits<M>::compact_factor == CompactFactor::none ||
            ManifoldTraits<M>::compact_factor == CompactFactor::unknown ||
            requires(const M& x) {
              ManifoldTraits<M>::compact_begin;
              ManifoldTraits<M>::compactCoordinates(x);
            },
        "ManifoldTraits with a compact_factor also say compact_begin and compactCoordinates(x)");
    return ManifoldTraits<M>::compact_factor;
  } else {
    return CompactFactor::unknown;
  }
}

}  // namespace detail

/// A manifold embedded in a linear space, where features can be averaged: ChordalMoments is default constructible,
/// add(x, p) adds a feature of weight p, mean() is the feature nearest to the average, or nothing where none is. The
/// mean of one feature is that feature, and acting on all features acts on a mean that is unique. Iterations for means
/// start there.
template <class M>
concept HasChordalMoments = Homogeneous<M> && requires(typename ManifoldTraits<M>::ChordalMoments sums, const M& x,
                                                       const typename ManifoldTraits<M>::Scalar& weight) {
  sums.add(x, weight);
  { sums.mean() } -> std::convertible_to<std::optional<M>>;
};

/// SO(3), SO(3) × R³ under the product metric with the tangent order (translation, rotation), and their Quotients, in
/// memory: parameters(x) points to the quaternion of compactCoordinates(x), followed by the position of x in the axes
/// of the world. Sums over many features are then vectorised, several features at a time.
template <class M>
concept HasRotationParameters = HasCompactFactor<M> && requires(const M& x) {
  { ManifoldTraits<M>::parameters(x) } -> std::convertible_to<const typename ManifoldTraits<M>::Scalar*>;
  requires ManifoldTraits<M>::compact_factor == CompactFactor::rotation;
  requires(ManifoldTraits<M>::DoF == 3 && ManifoldTraits<M>::compact_begin == 0) ||
      (ManifoldTraits<M>::DoF == 6 && ManifoldTraits<M>::compact_begin == 3);
};

/// The quantity that a part of a tangent vector measures.
enum class TangentPart {
  translation,  ///< m
  rotation,     ///< rad
  velocity,     ///< m/s
  log_scale,    ///< natural logarithm of a scale
  point,        ///< in R^n: m, or whatever unit the coordinates have
  direction     ///< on S²: rad
};

/// The name used in files and messages.
constexpr const char* name(TangentPart part) {
  switch (part) {
    case TangentPart::translation:
      return "translation";
    case TangentPart::rotation:
      return "rotation";
    case TangentPart::velocity:
      return "velocity";
    case TangentPart::log_scale:
      return "log_scale";
    case TangentPart::point:
      return "point";
    case TangentPart::direction:
      return "direction";
  }
  return "unknown";
}

/// True for rotations and directions, whose coordinates are in rad.
constexpr bool isAngular(TangentPart part) { return part == TangentPart::rotation || part == TangentPart::direction; }

/// Consecutive coordinates of a tangent vector and the quantity that they measure.
struct TangentBlock {
  TangentPart part = TangentPart::point;
  int begin = 0, size = 0;
};

/// A manifold whose traits describe the parts of its tangent vectors: tangent_parts is an array of TangentBlock, each
/// beginning where the previous one ends, that covers all coordinates.
template <class M>
concept HasTangentParts = Homogeneous<M> && requires {
  { ManifoldTraits<M>::tangent_parts[0] } -> std::convertible_to<TangentBlock>;
};

/// A manifold without a metric that has a Metric twin of the same dimension: metricTwin(x) and fromMetricTwin(y) are
/// inverses of each other and preserve the rotation. If the rotation of a mean is that of the twin's mean (the
/// barycentre of SE(3)), the certificates of the twin's mean apply to it. Metric manifolds are their own twins.
template <class M>
concept HasMetricTwin = Homogeneous<M> && requires(const M& x) {
  { ManifoldTraits<M>::fromMetricTwin(ManifoldTraits<M>::metricTwin(x)) } -> std::convertible_to<M>;
};

}  // namespace liestat
