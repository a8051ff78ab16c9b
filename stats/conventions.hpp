// Covariances from and to other conventions than the library's: side of the perturbation, order of the tangent
// coordinates, axes. The fourth, the chart, is principalChartCovariance in stats/gaussian.hpp.
//
// The library's own: x·Exp(e), e ~ N(0, Σ), coordinates along the axes that x carries, translation before rotation.
//   left             Exp(e)·x: the error is a motion of the world about its origin (Barfoot; GTSAM is right, as here)
//   world axes       rotation R ← Exp(δ)·R, position t ← t + τ, each along the axes of the world
//                    (ROS' PoseWithCovariance)
//   rotation first   GTSAM, Barrau and Bonnabel
// A type's tangent order is that of its traits' tangent_parts (lie/concepts.hpp).
#pragma once

#include <lie/detail/small_products.hpp>
#include <stats/gaussian.hpp>

#include <initializer_list>

namespace liestat {

/// Covariance of the left perturbation of a group, Exp(e)·mean: Adj Σ Adjᵀ; exact, in the library's tangent order.
template <LieGroup G>
SquareOf<G> leftCovariance(const Gaussian<G>& g) {
  const SquareOf<G> J = g.mean.Adj();
  return detail::congruence(J, g.covariance);
}
/// The Gaussian of a mean and the covariance of its left perturbation; inverse of leftCovariance.
template <LieGroup G>
Gaussian<G> fromLeftCovariance(const G& mean, const SquareOf<G>& left_covariance) {
  const SquareOf<G> J = mean.inverse().Adj();
  return {mean, detail::congruence(J, left_covariance)};
}

/// The order of rotation, translation, then the rest. Parts that a type does not have are passed over, so it serves SE2
/// as well as SE23.
inline constexpr std::initializer_list<TangentPart> rotation_first = {TangentPart::rotation,    TangentPart::direction,
                                                                      TangentPart::translation, TangentPart::point,
                                                                      TangentPart::velocity,    TangentPart::log_scale};

namespace detail {

/// How the tangent coordinates at x turn into world axes, part by part: the diagonal blocks of the adjoint matrix of
/// the placement, diag(sR, R, sR, 1) for a similarity with a velocity.
template <HasTangentParts M>
SquareOf<M> worldAxes(const M& x) {
  using T = ManifoldTraits<M>;
  static_assert(T::Group::DoF == T::DoF, "tangent vectors at directions and the like have no axes of their own");
  const SquareOf<M> Adj = T::placement(x).Adj();
  SquareOf<M> J = SquareOf<M>::Zero();
  for (const TangentBlock& b : T::tangent_parts) {
    for (int i = b.begin; i < b.begin + b.size; ++i) {
      for (int j = b.begin; j < b.begin + b.size; ++j) J(i, j) = Adj(i, j);
    }
  }
  return J;
}

}  // namespace detail

/// The permutation P with P·v the tangent vector v of the library's order in another order of its parts, each of which
/// keeps its own coordinates. `order` names every part of M once; parts that M does not have are passed over.
///   tangentPermutation<SE23d>({TangentPart::rotation, TangentPart::velocity, TangentPart::translation})
template <HasTangentParts M>
Eigen::PermutationMatrix<ManifoldTraits<M>::DoF> tangentPermutation(std::initializer_list<TangentPart> order) {
  Eigen::PermutationMatrix<ManifoldTraits<M>::DoF> P;
  P.setIdentity();
  int to = 0;
  for (const TangentPart part : order) {
    for (const TangentBlock& b : ManifoldTraits<M>::tangent_parts) {
      if (b.part != part) continue;
      for (int i = 0; i < b.size; ++i) P.indices()[b.begin + i] = to++;
    }
  }
  eigen_assert(to == ManifoldTraits<M>::DoF);
  return P;
}

/// A covariance of the library's tangent order in another one, and back; see tangentPermutation.
///   covarianceInOrder<SE3d>(g.covariance, rotation_first)
template <HasTangentParts M>
SquareOf<M> covarianceInOrder(const SquareOf<M>& covariance, std::initializer_list<TangentPart> order) {
  const auto P = tangentPermutation<M>(order);
  return P * covariance * P.transpose();
}
template <HasTangentParts M>
SquareOf<M> covarianceFromOrder(const SquareOf<M>& covariance, std::initializer_list<TangentPart> order) {
  const auto P = tangentPermutation<M>(order);
  return P.transpose() * covariance * P;
}

/// Covariance along the axes of the world, each part for itself: R ← Exp(δ)·R, t ← t + τ (and the velocity likewise).
/// Exact for rotations and Frame3, first order for the groups of motions. It differs from leftCovariance by the lever
/// arm: there a turn of the world about its origin also moves t.
template <HasTangentParts M>
SquareOf<M> worldAxesCovariance(const Gaussian<M>& g) {
  const SquareOf<M> J = detail::worldAxes(g.mean);
  return detail::congruence(J, g.covariance);
}
/// The Gaussian of a mean and its covariance along the axes of the world; inverse of worldAxesCovariance.
template <HasTangentParts M>
Gaussian<M> fromWorldAxesCovariance(const M& mean, const SquareOf<M>& world_covariance) {
  const SquareOf<M> J = detail::inverse<ScalarOf<M>, ManifoldTraits<M>::DoF>(detail::worldAxes(mean));
  return {mean, detail::congruence(J, world_covariance)};
}

}  // namespace liestat
