// Covariances from and to other conventions than the library's: side of the perturbation, order of the tangent
// coordinates, axes. The fourth, the chart, is principalChartCovariance in stats/gaussian.hpp.
//
// The library's own: x·Exp(e), e ~ N(0, Σ), coordinates along the axes that x carries, translation before rotation.
//   left             Exp(e)·x: the error is a motion of the world about its origin (Barfoot; GTSAM is right, as here)
//   world axes       rotation R ← Exp(δ)·R, position t ← t + τ, each along the axes of the world (ROS'
//   PoseWithCovariance) rotation first   GTSAM, Barrau and Bonnabel
#pragma once

#include <stats/gaussian.hpp>

#include <array>
#include <cstddef>
#include <initializer_list>

namespace liestat {

/// Covariance of the left perturbation of a group, Exp(e)·mean: Adj Σ Adjᵀ; exact, in the library's tangent order.
template <LieGroup G>
SquareOf<G> leftCovariance(const Gaussian<G>& g) {
  const SquareOf<G> J = g.mean.Adj();
  return J * g.covariance * J.transpose();
}
/// The Gaussian of a mean and the covariance of its left perturbation; inverse of leftCovariance.
template <LieGroup G>
Gaussian<G> fromLeftCovariance(const G& mean, const SquareOf<G>& left_covariance) {
  const SquareOf<G> J = mean.inverse().Adj();
  return {mean, J * left_covariance * J.transpose()};
}

/// The parts that tangent vectors of rotations, motions, similarities and poses are made of.
enum class TangentPart { translation, rotation, velocity, log_scale };

/// The order of rotation, translation, then the rest. Parts that a type does not have are passed over, so it serves SE2
/// as well as SE23.
inline constexpr std::initializer_list<TangentPart> rotation_first = {TangentPart::rotation, TangentPart::translation,
                                                                      TangentPart::velocity, TangentPart::log_scale};

namespace detail {

/// Where a part of the tangent vector begins, and how many coordinates it has; none if the type lacks it.
struct PartRange {
  int first = 0, size = 0;
};

/// A type whose tangent vector is made of TangentParts, in their order.
template <class M>
concept HasTangentParts = Homogeneous<M> && requires(const M& x) {
  x.rotationMatrix();
};

/// The parts of M's tangent vector, indexed by TangentPart.
template <HasTangentParts M>
constexpr std::array<PartRange, 4> tangentParts() {
  constexpr int dim = ManifoldTraits<M>::Group::Dim;
  constexpr bool translation = requires(const M& x) { x.translation(); };
  constexpr bool velocity = requires(const M& x) { x.velocity(); };
  constexpr bool scale = requires(const M& x) { x.scale(); };
  constexpr int t = translation ? dim : 0, r = dim == 2 ? 1 : 3, v = velocity ? dim : 0, s = scale ? 1 : 0;
  static_assert(t + r + v + s == ManifoldTraits<M>::DoF,
                "the tangent vector of this type is not made of translation, rotation, velocity and scale");
  return {{{0, t}, {t, r}, {t + r, v}, {t + r + v, s}}};
}

/// How the tangent coordinates at x turn into world axes: diag(sR, R, sR, 1).
template <HasTangentParts M>
SquareOf<M> worldAxes(const M& x) {
  constexpr auto parts = tangentParts<M>();
  const auto R = x.rotationMatrix();
  auto linear = R;
  if constexpr (requires { x.scale(); }) linear *= x.scale();
  SquareOf<M> J = SquareOf<M>::Identity();
  constexpr int dim = ManifoldTraits<M>::Group::Dim;
  if constexpr (parts[0].size > 0) J.template block<dim, dim>(0, 0) = linear;
  if constexpr (dim == 3) J.template block<3, 3>(parts[1].first, parts[1].first) = R;
  if constexpr (parts[2].size > 0) J.template block<dim, dim>(parts[2].first, parts[2].first) = linear;
  return J;
}

}  // namespace detail

/// The permutation P with P·v the tangent vector v of the library's order in another order of its parts, each of which
/// keeps its own coordinates. `order` names every part of M once; parts that M does not have are passed over.
///   tangentPermutation<SE23d>({TangentPart::rotation, TangentPart::velocity, TangentPart::translation})
template <detail::HasTangentParts M>
Eigen::PermutationMatrix<ManifoldTraits<M>::DoF> tangentPermutation(std::initializer_list<TangentPart> order) {
  constexpr auto parts = detail::tangentParts<M>();
  Eigen::PermutationMatrix<ManifoldTraits<M>::DoF> P;
  P.setIdentity();
  int to = 0;
  for (const TangentPart part : order) {
    const detail::PartRange range = parts[static_cast<std::size_t>(part)];
    eigen_assert(to + range.size <= ManifoldTraits<M>::DoF);
    for (int i = 0; i < range.size; ++i) P.indices()[range.first + i] = to++;
  }
  eigen_assert(to == ManifoldTraits<M>::DoF);
  return P;
}

/// A covariance of the library's tangent order in another one, and back; see tangentPermutation.
///   covarianceInOrder<SE3d>(g.covariance, rotation_first)
template <detail::HasTangentParts M>
SquareOf<M> covarianceInOrder(const SquareOf<M>& covariance, std::initializer_list<TangentPart> order) {
  const auto P = tangentPermutation<M>(order);
  return P * covariance * P.transpose();
}
template <detail::HasTangentParts M>
SquareOf<M> covarianceFromOrder(const SquareOf<M>& covariance, std::initializer_list<TangentPart> order) {
  const auto P = tangentPermutation<M>(order);
  return P.transpose() * covariance * P;
}

/// Covariance along the axes of the world, each part for itself: R ← Exp(δ)·R, t ← t + τ (and the velocity likewise).
/// Exact for rotations and Frame3, first order for the groups of motions. It differs from leftCovariance by the lever
/// arm: there a turn of the world about its origin also moves t.
template <detail::HasTangentParts M>
SquareOf<M> worldAxesCovariance(const Gaussian<M>& g) {
  const SquareOf<M> J = detail::worldAxes(g.mean);
  return J * g.covariance * J.transpose();
}
/// The Gaussian of a mean and its covariance along the axes of the world; inverse of worldAxesCovariance.
template <detail::HasTangentParts M>
Gaussian<M> fromWorldAxesCovariance(const M& mean, const SquareOf<M>& world_covariance) {
  const SquareOf<M> J = detail::inverse<ScalarOf<M>, ManifoldTraits<M>::DoF>(detail::worldAxes(mean));
  return {mean, J * world_covariance * J.transpose()};
}

}  // namespace liestat
