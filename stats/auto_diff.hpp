// Jacobians between manifolds by automatic differentiation, and the propagation of covariances with them. Needs Eigen
// alone.
//
//   const auto range_and_bearing = [](const auto& world_T_body) { … };   // generic in the scalar
//   const auto measured = liestat::propagate(world_T_body, range_and_bearing);
//
// Functions are called twice: with doubles for the value, and with Jets (lie/jet.hpp) for the derivative. They take
// their features as they are (`const auto&`, or `template <class T> … (const SE3<T>&)`) and call sqrt, sin …
// unqualified. double and Jet meet in the groups' operators: a constant SE3d times an SE3<Jet> is an SE3<Jet>.
#pragma once

#include <lie/jet.hpp>
#include <stats/constrained_types.hpp>
#include <stats/propagation.hpp>

#include <type_traits>
#include <utility>

namespace liestat {
namespace detail {

/// exp(x, d) for a d of Jets, on the same manifold over Jets. A type of a user's own needs cast<Jet>().
template <class J, Homogeneous M>
auto perturbed(const M& x, const Eigen::Matrix<J, ManifoldTraits<M>::DoF, 1>& d) {
  const auto lifted = asFeature<J>(x.template cast<J>());
  return exp(lifted, d);
}

/// A feature over Jets of so many derivatives.
template <int Columns, Homogeneous M>
auto overJets(const M& x) {
  using J = Jet<ScalarOf<M>, Columns>;
  return asFeature<J>(x.template cast<J>());
}

/// The scalar of a feature, or a number.
template <class R>
struct ScalarOfResult {
  using type = R;
};
template <Homogeneous R>
struct ScalarOfResult<R> {
  using type = ScalarOf<R>;
};
/// A function takes features over Jets, and returns something over Jets. (Eigen's matrices convert into each other as
/// far as a signature says, so that the arguments alone do not tell.)
template <class F, class... M>
concept GenericInScalar =
    std::is_invocable_v<const F&, decltype(overJets<1>(std::declval<const M&>()))...> && requires {
  ScalarOfResult<std::remove_cvref_t<
      std::invoke_result_t<const F&, decltype(overJets<1>(std::declval<const M&>()))...>>>::type::DIMENSION;
};

/// Coordinates from `first` on, each with its own derivative, all zero.
template <class J, int N>
Eigen::Matrix<J, N, 1> infinitesimals(int first) {
  Eigen::Matrix<J, N, 1> d;
  for (int i = 0; i < N; ++i) d[i] = J(typename J::Scalar(0), first + i);
  return d;
}

/// The derivative of log(value, moved) at moved = value, and that of all the infinitesimals.
template <int Columns, Homogeneous N, class Moved>
Eigen::Matrix<ScalarOf<N>, ManifoldTraits<N>::DoF, Columns> localDerivative(const N& value, const Moved& moved) {
  using J = Jet<ScalarOf<N>, Columns>;
  const auto base = asFeature<J>(value.template cast<J>());
  static_assert(std::is_same_v<decltype(base), const Moved>,
                "the function must return the same feature over Jets as over doubles");
  const Eigen::Matrix<J, ManifoldTraits<N>::DoF, 1> z = log(base, moved);
  Eigen::Matrix<ScalarOf<N>, ManifoldTraits<N>::DoF, Columns> derivative;
  for (int i = 0; i < ManifoldTraits<N>::DoF; ++i) derivative.row(i) = z[i].v.transpose();
  return derivative;
}

/// f(a, b) with both Jacobians.
template <class F, Homogeneous A, Homogeneous B>
auto linearized(F& f, const A& a, const B& b) {
  constexpr int n_a = ManifoldTraits<A>::DoF, n = n_a + ManifoldTraits<B>::DoF;
  using J = Jet<ScalarOf<A>, n>;
  const auto value = evaluated<ScalarOf<A>>(f, a, b);
  using N = std::remove_const_t<decltype(value)>;
  const auto moved =
      evaluated<J>(f, perturbed<J>(a, infinitesimals<J, n_a>(0)), perturbed<J>(b, infinitesimals<J, n - n_a>(n_a)));
  const auto both = localDerivative<n>(value, moved);
  return Linearized<N, A, B>{value, both.template leftCols<n_a>(), both.template rightCols<n - n_a>()};
}

}  // namespace detail

/// Derivative of f at x in local frames, log(f(x), f(exp(x, d))) = J d + O(d²): JacobianOf<N, M>, exact up to rounding.
template <class F, Homogeneous M>
auto jacobian(F&& f, const M& x) {
  constexpr int n = ManifoldTraits<M>::DoF;
  using J = Jet<ScalarOf<M>, n>;
  return detail::localDerivative<n>(detail::evaluated<ScalarOf<M>>(f, x),
                                    detail::evaluated<J>(f, detail::perturbed<J>(x, detail::infinitesimals<J, n>(0))));
}

/// f(x) with covariance J Σ Jᵀ, first order. `f` is generic in the scalar; it returns a feature, a fixed-size vector or
/// a number (a point of the line).
template <Homogeneous M, class F>
  requires std::is_invocable_v<F&, const M&>
auto propagate(const Gaussian<M>& x, F&& f) { return propagate(x, f, jacobian(f, x.mean)); }

/// f(a, b) of independent features.
template <Homogeneous A, Homogeneous B, class F>
  requires std::is_invocable_v<F&, const A&, const B&>
auto propagate(const Gaussian<A>& a, const Gaussian<B>& b, F&& f) {
  return detail::linearized(f, a.mean, b.mean).of(a.covariance, b.covariance);
}
/// f(a, b) of correlated features, cross = E[e_a e_bᵀ].
template <Homogeneous A, Homogeneous B, class F>
  requires std::is_invocable_v<F&, const A&, const B&>
auto propagate(const Gaussian<A>& a, const Gaussian<B>& b, const CrossCovariance<A, B>& cross, F&& f) {
  return detail::linearized(f, a.mean, b.mean).of(a.covariance, b.covariance, cross);
}

namespace detail {

/// The number of independent equations, of a function that says it.
template <class F>
struct SaysRank {};
template <class F>
  requires requires { F::rank; }
struct SaysRank<F> {
  static constexpr int rank = F::rank;
};

}  // namespace detail

/// An equation or a constraint of stats/constrained.hpp out of a function that is generic in the scalar: f(q, m), or f(q),
/// returns a fixed-size vector or a number.
template <class F>
struct AutoDiff : detail::SaysRank<F> {
  F f;

  template <Homogeneous... M>
  auto operator()(const M&... features) const {
    using S = std::common_type_t<ScalarOf<M>...>;
    return detail::evaluated<S>(f, features...);
  }
  template <Homogeneous Q, Homogeneous M>
    requires detail::GenericInScalar<F, Q, M>
  auto linearize(const Q& q, const M& m) const {
    const auto found = detail::linearized(f, q, m);
    using Value = std::remove_cvref_t<decltype(found.value)>;
    return EquationDerivatives<Value::RowsAtCompileTime, ManifoldTraits<Q>::DoF, ManifoldTraits<M>::DoF>{
        found.value.template cast<double>(), found.by_a.template cast<double>(), found.by_b.template cast<double>()};
  }
  template <Homogeneous Q>
    requires detail::GenericInScalar<F, Q>
  auto linearize(const Q& q) const {
    const auto found = (*this)(q);
    using Value = std::remove_cvref_t<decltype(found)>;
    return ConstraintDerivatives<Value::RowsAtCompileTime, ManifoldTraits<Q>::DoF>{
        found.template cast<double>(), jacobian(f, q).template cast<double>()};
  }
};
template <class F>
AutoDiff<F> autoDiff(F f) {
  return {{}, std::move(f)};
}

}  // namespace liestat
