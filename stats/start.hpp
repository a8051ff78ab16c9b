// Where an iteration for a mean starts: the chordal mean where an embedding offers one, else the best of several data.
//
// Started at the first measure the iteration ends in a wrong minimum for 1 to 3 % of widely spread rotations and for a
// third of widely spread quotient frames (means.md, section 5.2).
#pragma once

#include <lie/detail/part_tuple.hpp>
#include <lie/manifold.hpp>
#include <stats/detail/rotation_sums.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <limits>
#include <ranges>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

/// Unit eigenvector of the largest eigenvalue of a symmetric positive semi-definite 4×4 matrix, by repeated squaring of
/// the normalised matrix: its powers tend to the projector on the dominant eigenvectors. Ties give one of them.
template <class S>
Eigen::Matrix<S, 4, 1> dominantEigenvector(Eigen::Matrix<S, 4, 4> A) {
  for (int i = 0; i < 24; ++i) {
    const S trace = A.trace();
    if (!(trace > S(0))) break;
    A /= trace;
    A = (A * A).eval();
  }
  Eigen::Index column = 0;
  A.diagonal().maxCoeff(&column);
  return A.col(column).normalized();
}

/// Σ p q qᵀ and its dominant eigenvector: the chordal mean of rotations.
template <class S>
struct QuaternionMoments {
  Eigen::Matrix<S, 4, 4> sum = Eigen::Matrix<S, 4, 4>::Zero();
  void add(const Eigen::Matrix<S, 4, 1>& q, const S& p) { sum.noalias() += p * q * q.transpose(); }
  Eigen::Matrix<S, 4, 1> mean() const { return dominantEigenvector(sum); }
};

/// The datum with the least cost among a few, spread over the data; the cost is taken on a subset.
template <class M, class R, class W>
M bestOfSeveral(const R& samples, const W& weights, std::size_t candidates = 8, std::size_t judges = 64) {
  using S = ScalarOf<M>;
  const std::size_t n = std::ranges::size(samples);
  const auto at = [&](std::size_t k, std::size_t of) { return static_cast<std::ptrdiff_t>(k * n / of); };
  candidates = std::min(candidates, n), judges = std::min(judges, n);
  using T = ManifoldTraits<M>;
  std::vector<M> judging;
  std::vector<S> weight;
  judging.reserve(judges), weight.reserve(judges);
  for (std::size_t j = 0; j < judges; ++j) {
    judging.push_back(samples[at(j, judges)]);
    weight.push_back(S(weights[static_cast<std::size_t>(at(j, judges))]));
  }
  const auto cost_at = [&](const M& y) {
    if constexpr (HasRotationSums<M>) {
      RotationSums<M> sums;
      if (sums.template add<true, false>(judging, weight, 0, judges, y)) return sums.cost;
    }
    const typename T::Group to_y = T::placement(y).inverse();
    S cost(0);
    for (std::size_t j = 0; j < judges; ++j) {
      cost += S(0.5) * weight[j] * T::logOrigin(T::act(to_y, judging[j])).squaredNorm();
    }
    return cost;
  };
  S best_cost = std::numeric_limits<S>::infinity();
  std::ptrdiff_t best = 0;
  for (std::size_t c = 0; c < candidates; ++c) {
    const S cost = cost_at(samples[at(c, candidates)]);
    if (cost < best_cost) best_cost = cost, best = at(c, candidates);
  }
  return samples[best];
}

/// The factors of M, as a std::tuple.
template <Factored M>
using FactorsOf = std::decay_t<decltype(ManifoldTraits<M>::factors(std::declval<const M&>()))>;

/// The I-th factors of a range of features, as they are asked for.
template <std::size_t I, Factored M, class R>
struct FactorRange {
  const R& samples;
  std::size_t size() const { return std::ranges::size(samples); }
  std::tuple_element_t<I, FactorsOf<M>> operator[](std::ptrdiff_t k) const {
    return std::get<I>(ManifoldTraits<M>::factors(samples[k]));
  }
};

/// Manifolds whose start is the mean itself: linear spaces.
template <Homogeneous M>
inline constexpr bool starts_at_mean = std::same_as<M, TangentOf<M>>;

/// Rotations and poses of the plane. Not those with a scale, by which a mean of parameters would weigh.
template <Homogeneous M>
inline constexpr bool has_unit_complex = [] {
  if constexpr (requires(const M& x) { x.scale(); }) {
    return false;
  } else {
    return requires(const M& x) { x.so2(); }
    || requires(const M& x) { x.unit_complex(); };
  }
}();

}  // namespace detail

/// A start for the mean of a non-empty range of features. One pass over the data where the manifold sits in a linear
/// space (vectors, rotations, directions, frames); quotients take the best of eight data; products start by factors.
template <Homogeneous M, class R, class W>
M startOfMean(const R& samples, const W& weights) {
  using S = ScalarOf<M>;
  const std::size_t n = std::ranges::size(samples);
  const auto sample = [&](std::size_t i) -> decltype(auto) { return samples[static_cast<std::ptrdiff_t>(i)]; };
  if constexpr (Factored<M>) {
    using Factors = detail::FactorsOf<M>;
    return [&]<std::size_t... I>(std::index_sequence<I...>) {
      return M(ManifoldTraits<M>::fromFactors(
          Factors(startOfMean<std::tuple_element_t<I, Factors>>(detail::FactorRange<I, M, R>{samples}, weights)...)));
    }
    (std::make_index_sequence<std::tuple_size_v<Factors>>{});
  } else if constexpr (detail::starts_at_mean<M>) {
    M sum = M::Zero();
    S weight(0);
    for (std::size_t i = 0; i < n; ++i) sum += S(weights[i]) * sample(i), weight += S(weights[i]);
    return sum / weight;
  } else if constexpr (!Quotient<M> && requires(const M& x) { x.unit_quaternion(); }) {  // rotations, poses of R^3
    detail::QuaternionMoments<S> rotations;
    // What follows the quaternion are vectors: translation, velocity.
    constexpr int vectors = M::num_parameters - 4;
    Eigen::Matrix<S, vectors, 1> translation = Eigen::Matrix<S, vectors, 1>::Zero();
    S weight(0);
    for (std::size_t i = 0; i < n; ++i) {
      const M& x = sample(i);
      const S p = S(weights[i]);
      rotations.add(x.params().template head<4>(), p);
      weight += p;
      translation += p * x.params().template tail<vectors>();
    }
    typename M::Params params;
    params.template head<4>() = rotations.mean();
    if constexpr (vectors > 0) params.template tail<vectors>() = translation / weight;
    return M::fromParams(params);
  } else if constexpr (detail::has_unit_complex<M>) {
    typename M::Params sum = M::Params::Zero();
    S weight(0);
    for (std::size_t i = 0; i < n; ++i) sum += S(weights[i]) * sample(i).params(), weight += S(weights[i]);
    const S norm = sum.template head<2>().norm();
    if (!(norm > S(0))) return detail::bestOfSeveral<M>(samples, weights);
    sum /= weight;
    sum.template head<2>().normalize();
    return M::fromParams(sum);
  } else if constexpr (requires(const M& x) { x.unit_vector(); }) {
    Eigen::Matrix<S, 3, 1> sum = Eigen::Matrix<S, 3, 1>::Zero();
    for (std::size_t i = 0; i < n; ++i) sum += S(weights[i]) * sample(i).unit_vector();
    if (!(sum.norm() > S(1e-6) * S(n))) return detail::bestOfSeveral<M>(samples, weights);
    return M(sum);
  } else {
    return detail::bestOfSeveral<M>(samples, weights);
  }
}

}  // namespace liestat
