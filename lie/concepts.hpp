// The contracts that the library is written against: LieGroup, Homogeneous, Metric.
//
// Pennec 1998, section 2.2: the action of a transformation group with its Jacobians and the placement function with its
// Jacobian are the only atomic operations; everything else follows from them once, for every type of feature.
//
// Invariants of a Homogeneous manifold M with traits T = ManifoldTraits<M> (checked by lie/testing.hpp):
//   1. act(placement(x), origin()) == x, and placement(origin()) is the identity
//   2. act(f, act(g, x)) == act(f * g, x), act(identity, x) == x
//   3. logOrigin(expOrigin(v)) == v inside the injectivity domain; expOrigin(logOrigin(x)) == x everywhere
//   4. isotropy(f, x) is how placement(f x)⁻¹ f placement(x) acts on the tangent space of the origin
//   5. placement(x·exp(v)) == placement(x)·Exp(placementJacobian(x) v + O(v²)) wherever isPlacementSmooth(x)
//   6. logOrigin(p·exp(v)) == logOrigin(p) + dlogOrigin(p) v + O(v²); dexpOrigin is its inverse
//   7. Exp(d) acts on the origin as exp(originProjection() d + O(d²))
// and of a Metric manifold, besides:
//   8. the distance is invariant: distance(f x, f y) == distance(x, y), symmetric, and satisfies the triangle
//   inequality
//   9. hessianHalfSquaredDistance(z) is the Hessian of ½ d²(·, x) at y, z = log(y, x), along geodesics
// and of a Quotient:
//  10. nothing depends on the representative: representative(x, i), i in representatives, is the same feature, tangent
//      vectors v at x are representativeJacobian(i) v there; logOrigin takes the nearest representative
// Tangent vectors at x live in the frame that placement(x) carries there.
// Where the isotropy is not trivial and placement(expOrigin(v)) does not carry the origin's frame in parallel, the
// traits provide transvection(p), which does, and transvectionJacobian(), its derivative at the origin.
#pragma once

#include <Eigen/Core>

#include <concepts>

namespace liestat {

/// The operations that make M a manifold, as static members. Types of the library specialise it in their own header; a
/// user's type becomes a manifold by a specialisation of his own, without touching the type. Undefined in general.
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

/// A Metric manifold made of a finite quotient: several representatives, of which logOrigin takes the nearest.
template <class M>
concept Quotient = Homogeneous<M> && requires(const M& x) {
  ManifoldTraits<M>::nearestRepresentative(x);
  ManifoldTraits<M>::representatives[0];
  { ManifoldTraits<M>::representative(x, 0) } -> std::convertible_to<M>;
  { ManifoldTraits<M>::representativeJacobian(0) } -> std::convertible_to<typename ManifoldTraits<M>::Square>;
};

/// A manifold whose traits take it apart: factors(x) is a std::tuple of features of other manifolds, fromFactors(tuple)
/// goes back, and where there is a metric the squared distance is the sum of the factors'. Means, their starts and
/// their certificates of uniqueness are then those of the factors.
template <class M>
concept Factored = Homogeneous<M> && requires(const M& x) {
  { ManifoldTraits<M>::fromFactors(ManifoldTraits<M>::factors(x)) } -> std::convertible_to<M>;
};

}  // namespace liestat
