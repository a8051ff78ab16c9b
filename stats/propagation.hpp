// Propagation of covariance: features composed, inverted, compared, moved, or put into any differentiable function
// (first order; composeFourthOrder for more).
//
// Errors are in the library's convention, x·Exp(e) with e ~ N(0, Σ) in the local frame, at the inputs and at the
// result. First order means that the result's error is the linear image of the inputs' errors: right up to relative
// errors of the order of the noise squared, docs/propagation.md says how far that carries. Inputs are independent
// unless a cross-covariance E[e_a e_bᵀ] is given. NaN in, NaN out.
//
// Source: T. D. Barfoot and P. T. Furgale, "Associating uncertainty with three-dimensional poses for use in estimation
// problems", IEEE Transactions on Robotics 30(3), 2014; their perturbations are on the left.
#pragma once

#include <lie/detail/small_products.hpp>
#include <stats/gaussian.hpp>

#include <array>
#include <functional>
#include <type_traits>
#include <utility>

namespace liestat {

/// E[e_a e_bᵀ] of the errors of two features, each in its own local frame.
template <Homogeneous A, Homogeneous B = A>
using CrossCovariance = Eigen::Matrix<ScalarOf<A>, ManifoldTraits<A>::DoF, ManifoldTraits<B>::DoF>;

/// Derivative of a function from M to N, with respect to local coordinates at its argument and in the local frame of
/// its value: log(f(x), f(exp(x, d))) = J d + O(d²).
template <Homogeneous N, Homogeneous M>
using JacobianOf = Eigen::Matrix<ScalarOf<N>, ManifoldTraits<N>::DoF, ManifoldTraits<M>::DoF>;

namespace detail {

/// J_a C J_bᵀ and its transpose, what correlation adds to the covariance of a sum.
template <class S, int N, int A, int B>
Eigen::Matrix<S, N, N> correlated(const Eigen::Matrix<S, N, A>& J_a, const Eigen::Matrix<S, A, B>& cross,
                                  const Eigen::Matrix<S, N, B>& J_b) {
  const Eigen::Matrix<S, N, N> half = productTransposed(product(J_a, cross), J_b);
  return half + half.transpose();
}

/// The mean and the Jacobians of a function of two features.
template <Homogeneous N, Homogeneous A, Homogeneous B>
struct Linearized {
  N value;
  JacobianOf<N, A> by_a;
  JacobianOf<N, B> by_b;

  Gaussian<N> of(const SquareOf<A>& a, const SquareOf<B>& b) const {
    return {value, congruence(by_a, a) + congruence(by_b, b)};
  }
  Gaussian<N> of(const SquareOf<A>& a, const SquareOf<B>& b, const CrossCovariance<A, B>& cross) const {
    return {value, congruence(by_a, a) + congruence(by_b, b) + correlated(by_a, cross, by_b)};
  }
};

template <LieGroup G>
Linearized<G, G, G> linearizedCompose(const G& a, const G& b) {
  return {a * b, b.inverse().Adj(), SquareOf<G>::Identity()};
}

template <Homogeneous M>
Linearized<M, M, M> linearizedBetween(const M& x, const M& y) {
  using T = ManifoldTraits<M>;
  const typename T::Group to_x = T::placement(x), f = to_x.inverse();
  // placement(exp(x, e))⁻¹ = f·Exp(-Adj(placement(x)) P e), P the derivative of the placement.
  return {act(f, y), -product(product(actionTransformationJacobian(f, y), to_x.Adj()), T::placementJacobian(x)),
          actionFeatureJacobian(f, y)};
}

template <Homogeneous M>
Linearized<M, typename ManifoldTraits<M>::Group, M> linearizedAct(const typename ManifoldTraits<M>::Group& f,
                                                                  const M& x) {
  return {act(f, x), actionTransformationJacobian(f, x), actionFeatureJacobian(f, x)};
}

/// A group that moves points P of R^Dim beside what it acts on by its traits: SE3 and Sim3 on Vector3d, SE2 on
/// Vector2d.
template <class G, class P>
concept MovesPoints = LieGroup<G> && std::is_same_v<P, typename G::Point> && requires(const G& f, const P& p) {
  f.matrix();
  G::Dx_exp_x_times_point_at_0(p);
};

template <class G, class P>
  requires MovesPoints<G, P> Linearized<P, G, P> linearizedAct(const G& f, const P& p) {
    const Eigen::Matrix<typename G::Scalar, G::Dim, G::Dim> linear =
        f.matrix().template topLeftCorner<G::Dim, G::Dim>();
    return {f * p, linear * G::Dx_exp_x_times_point_at_0(p), linear};
  }

/// The return value of a user's function as a feature of its own: Eigen's expressions and views are evaluated, a number
/// is a point of the line.
template <class S, class R>
auto asFeature(const R& result) {
  if constexpr (std::is_same_v<R, S>) {
    return Eigen::Matrix<S, 1, 1>(result);
  } else if constexpr (requires { typename R::PlainObject; }) {
    return typename R::PlainObject(result);
  } else if constexpr (requires { typename R::Plain; }) {
    return typename R::Plain(result);
  } else {
    return result;
  }
}

/// f(x…) as a feature.
template <class S, class F, class... M>
auto evaluated(F& f, const M&... x) {
  auto value = asFeature<S>(std::invoke(f, x...));
  static_assert(Homogeneous<decltype(value)>, "the function must return a feature, a fixed-size vector or a number");
  return value;
}

/// A Jacobian given as a matrix, or as a function of what it depends on.
template <class J, class... M>
decltype(auto) jacobianAt(const J& jacobian, const M&... x) {
  // Asked this way round: Eigen's matrices take any argument in parentheses, for an index.
  if constexpr (requires { typename J::PlainObject; }) {
    return (jacobian);
  } else {
    return std::invoke(jacobian, x...);
  }
}

}  // namespace detail

// --- Groups ---------------------------------------------------------------------------------------------------------

/// a·b: covariance Adj(b)⁻¹ Σ_a Adj(b)⁻ᵀ + Σ_b, to first order.
template <LieGroup G>
Gaussian<G> compose(const Gaussian<G>& a, const Gaussian<G>& b) {
  return detail::linearizedCompose(a.mean, b.mean).of(a.covariance, b.covariance);
}
/// a·b of correlated factors.
template <LieGroup G>
Gaussian<G> compose(const Gaussian<G>& a, const Gaussian<G>& b, const CrossCovariance<G>& cross) {
  return detail::linearizedCompose(a.mean, b.mean).of(a.covariance, b.covariance, cross);
}
/// a·b with an exact factor; exact.
template <LieGroup G>
Gaussian<G> compose(const Gaussian<G>& a, const G& b) {
  return {a.mean * b, detail::congruence(SquareOf<G>(b.inverse().Adj()), a.covariance)};
}
template <LieGroup G>
Gaussian<G> compose(const G& a, const Gaussian<G>& b) {
  return {a * b.mean, b.covariance};
}

/// x⁻¹: covariance Adj(x) Σ Adj(x)ᵀ; exact.
template <LieGroup G>
Gaussian<G> inverse(const Gaussian<G>& x) {
  return {x.mean.inverse(), detail::congruence(SquareOf<G>(x.mean.Adj()), x.covariance)};
}

/// a·b of independent factors, the covariance to fourth order in the noise: of the logarithm's exact second moment by
/// the Baker-Campbell-Hausdorff series, what is left out is of sixth order. The mean is a·b as it is. The
/// compounding of Barfoot and Furgale, for any group; some ten times the work of compose.
template <LieGroup G>
Gaussian<G> composeFourthOrder(const Gaussian<G>& a, const Gaussian<G>& b) {
  using Square = SquareOf<G>;
  using S = ScalarOf<G>;
  constexpr int n = G::DoF;
  // (a·b)⁻¹·a Exp(e_a)·b Exp(e_b) = Exp(Adj(b)⁻¹ e_a)·Exp(e_b): two factors at the identity, P and Q.
  const Square P = detail::congruence(Square(b.mean.inverse().Adj()), a.covariance);
  const Square& Q = b.covariance;
  // Σ_j P_ij ad(e_j), and then E[ad(p) ad(p)] = A_P, likewise A_Q, and E[ad(p) q qᵀ ad(p)ᵀ] = B.
  Square A_P = Square::Zero(), A_Q = Square::Zero(), B = Square::Zero();
  std::array<Square, static_cast<std::size_t>(n)> basis;
  for (int i = 0; i < n; ++i) {
    basis[static_cast<std::size_t>(i)] = G::ad(TangentOf<G>(TangentOf<G>::Unit(i)));
  }
  for (int i = 0; i < n; ++i) {
    Square by_p = Square::Zero(), by_q = Square::Zero();
    for (int j = 0; j < n; ++j) {
      by_p += P(i, j) * basis[static_cast<std::size_t>(j)];
      by_q += Q(i, j) * basis[static_cast<std::size_t>(j)];
    }
    const Square& ad = basis[static_cast<std::size_t>(i)];
    A_P += detail::product(ad, by_p);
    A_Q += detail::product(ad, by_q);
    B += detail::productTransposed(detail::product(ad, Q), by_p);
  }
  const Square twelfths = detail::product(A_P, Q) + detail::product(A_Q, P);
  return {a.mean * b.mean, P + Q + S(0.25) * B + (twelfths + twelfths.transpose()) / S(12)};
}

// --- Features under transformations ---------------------------------------------------------------------------------

/// y in the frame of x, placement(x)⁻¹⋆y: for a group x⁻¹·y, covariance Adj(z)⁻¹ Σ_x Adj(z)⁻ᵀ + Σ_y at the result z.
/// First order. On manifolds where the placement is a matter of choice (S2) so is the result.
template <Homogeneous M>
Gaussian<M> between(const Gaussian<M>& x, const Gaussian<M>& y) {
  return detail::linearizedBetween(x.mean, y.mean).of(x.covariance, y.covariance);
}
/// The same of correlated features.
template <Homogeneous M>
Gaussian<M> between(const Gaussian<M>& x, const Gaussian<M>& y, const CrossCovariance<M>& cross) {
  return detail::linearizedBetween(x.mean, y.mean).of(x.covariance, y.covariance, cross);
}
/// With one of them exact.
template <Homogeneous M>
Gaussian<M> between(const Gaussian<M>& x, const M& y) {
  return detail::linearizedBetween(x.mean, y).of(x.covariance, SquareOf<M>::Zero());
}
template <Homogeneous M>
Gaussian<M> between(const M& x, const Gaussian<M>& y) {
  return act(ManifoldTraits<M>::placement(x).inverse(), y);
}

/// The feature x moved by an uncertain transformation f of its group: covariance J_f Σ_f J_fᵀ + J_x Σ_x J_xᵀ, first
/// order. An exact transformation is act(f, x) of stats/gaussian.hpp.
template <Homogeneous M>
Gaussian<M> act(const Gaussian<typename ManifoldTraits<M>::Group>& f, const Gaussian<M>& x) {
  return detail::linearizedAct(f.mean, x.mean).of(f.covariance, x.covariance);
}
/// The same if f and x are correlated: cross = E[e_f e_xᵀ], Group::DoF × DoF.
template <Homogeneous M>
Gaussian<M> act(const Gaussian<typename ManifoldTraits<M>::Group>& f, const Gaussian<M>& x,
                const CrossCovariance<typename ManifoldTraits<M>::Group, M>& cross) {
  return detail::linearizedAct(f.mean, x.mean).of(f.covariance, x.covariance, cross);
}
/// An exact feature moved by an uncertain transformation. The covariance is singular where the group has fewer
/// dimensions than M or leaves directions alone.
template <Homogeneous M>
Gaussian<M> act(const Gaussian<typename ManifoldTraits<M>::Group>& f, const M& x) {
  return detail::linearizedAct(f.mean, x).of(f.covariance, SquareOf<M>::Zero());
}

/// Points of the plane or of space moved by rotations, motions or similarities, f⋆p; first order (exact where f is).
/// Translations, the group of ℝⁿ itself, need no function.
template <class G, class P>
  requires detail::MovesPoints<G, P> Gaussian<P> act(const Gaussian<G>& f, const Gaussian<P>& p) {
    return detail::linearizedAct(f.mean, p.mean).of(f.covariance, p.covariance);
  }
template <class G, class P>
  requires detail::MovesPoints<G, P> Gaussian<P> act(const Gaussian<G>& f, const Gaussian<P>& p,
                                                     const CrossCovariance<G, P>& cross) {
    return detail::linearizedAct(f.mean, p.mean).of(f.covariance, p.covariance, cross);
  }
template <class G, class P>
  requires detail::MovesPoints<G, P> Gaussian<P> act(const Gaussian<G>& f, const P& p) {
    return detail::linearizedAct(f.mean, p).of(f.covariance, SquareOf<P>::Zero());
  }
template <class G, class P>
  requires detail::MovesPoints<G, P> Gaussian<P> act(const G& f, const Gaussian<P>& p) {
    return detail::linearizedAct(f, p.mean).of(SquareOf<G>::Zero(), p.covariance);
  }

// --- Any differentiable function ------------------------------------------------------------------------------------

/// f(x) with covariance J Σ Jᵀ, first order. `f` takes an M and returns a feature N, a fixed-size vector or a number (a
/// point of the line); `jacobian` is JacobianOf<N, M>, N::DoF × M::DoF in local frames, or a function of x that returns
/// it. stats/auto_diff.hpp finds the Jacobian by itself.
template <Homogeneous M, class F, class J>
  requires std::is_invocable_v<F&, const M&>
auto propagate(const Gaussian<M>& x, F&& f, const J& jacobian) {
  const auto value = detail::evaluated<ScalarOf<M>>(f, x.mean);
  using N = std::remove_const_t<decltype(value)>;
  const JacobianOf<N, M> derivative = detail::jacobianAt(jacobian, x.mean);
  return Gaussian<N>{value, detail::congruence(derivative, x.covariance)};
}

/// f(a, b) of independent features: Jacobians with respect to each, as matrices or as functions of (a, b).
template <Homogeneous A, Homogeneous B, class F, class JA, class JB>
  requires std::is_invocable_v<F&, const A&, const B&>
auto propagate(const Gaussian<A>& a, const Gaussian<B>& b, F&& f, const JA& jacobian_a, const JB& jacobian_b) {
  const auto value = detail::evaluated<ScalarOf<A>>(f, a.mean, b.mean);
  using N = std::remove_const_t<decltype(value)>;
  return detail::Linearized<N, A, B>{value, detail::jacobianAt(jacobian_a, a.mean, b.mean),
                                     detail::jacobianAt(jacobian_b, a.mean, b.mean)}
      .of(a.covariance, b.covariance);
}
/// The same of correlated features.
template <Homogeneous A, Homogeneous B, class F, class JA, class JB>
  requires std::is_invocable_v<F&, const A&, const B&>
auto propagate(const Gaussian<A>& a, const Gaussian<B>& b, const CrossCovariance<A, B>& cross, F&& f,
               const JA& jacobian_a, const JB& jacobian_b) {
  const auto value = detail::evaluated<ScalarOf<A>>(f, a.mean, b.mean);
  using N = std::remove_const_t<decltype(value)>;
  return detail::Linearized<N, A, B>{value, detail::jacobianAt(jacobian_a, a.mean, b.mean),
                                     detail::jacobianAt(jacobian_b, a.mean, b.mean)}
      .of(a.covariance, b.covariance, cross);
}

}  // namespace liestat
