// Where an iteration for a mean starts: the chordal mean where an embedding offers one, else the best of several data.
//
// Started at the first measurement the iteration ends in a wrong minimum for 1 to 3 % of widely spread rotations and for
// a third of widely spread quotient frames (docs/theory/means.md, section 5.2).
#pragma once

#include <lie/detail/part_tuple.hpp>
#include <lie/manifold.hpp>
#include <stats/detail/factor_range.hpp>
#include <stats/detail/kernel_sums.hpp>
#include <stats/detail/moment_kernel.hpp>
#include <stats/detail/weights_of_one.hpp>
#include <stats/executor.hpp>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <optional>
#include <ranges>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

/// The datum with the least cost among a few, spread over the data; the cost is taken on a subset.
template <class M, class R, class W>
M bestOfSeveral(InstructionSet set, const R& samples, const W& weights, std::size_t candidates = 8,
                std::size_t judges = 64) {
  using S = ScalarOf<M>;
  const std::size_t n = std::ranges::size(samples);
  const auto at = [&](std::size_t k, std::size_t of) { return k * n / of; };
  candidates = std::min(candidates, n), judges = std::min(judges, n);
  using T = ManifoldTraits<M>;
  std::vector<M> judging;
  std::vector<S> weight;
  judging.reserve(judges), weight.reserve(judges);
  for (std::size_t j = 0; j < judges; ++j) {
    judging.push_back(samples[at(j, judges)]);
    weight.push_back(S(weights[at(j, judges)]));
  }
  const auto cost_at = [&](const M& y) {
    if constexpr (HasKernelSums<M>) {
      MeanPass<M> pass;
      constexpr bool weighted = !std::is_same_v<W, UnitWeights>;
      if (KernelSumsOf<M>::type::template add<weighted, KernelPass::step>(set, judging, weight, 0, judges, y, pass)) {
        return pass.sums.cost;
      }
    }
    const typename T::Group to_y = T::placement(y).inverse();
    S cost(0);
    for (std::size_t j = 0; j < judges; ++j) {
      cost += S(0.5) * weight[j] * T::logOrigin(T::act(to_y, judging[j])).squaredNorm();
    }
    return cost;
  };
  S best_cost = std::numeric_limits<S>::infinity();
  std::size_t best = 0;
  for (std::size_t c = 0; c < candidates; ++c) {
    const S cost = cost_at(samples[at(c, candidates)]);
    if (cost < best_cost) best_cost = cost, best = at(c, candidates);
  }
  return samples[best];
}

/// Manifolds whose start is the mean itself: linear spaces.
template <Homogeneous M>
inline constexpr bool starts_at_mean = HasChordalMoments<M>&& compactFactor<M>() == CompactFactor::none;

}  // namespace detail

/// A start for the mean of a non-empty range of features. One pass over the data where the manifold sits in a linear
/// space (HasChordalMoments: vectors, rotations, directions, frames); the others, and features that cancel, take the
/// best of eight data; products start by factors. The same bits on any executor.
template <Homogeneous M, Executor E, class R, class W>
M startOfMean(const E& executor, const R& samples, const W& weights) {
  using S = ScalarOf<M>;
  if constexpr (Factored<M>) {
    using Factors = detail::FactorsOf<M>;
    return [&]<std::size_t... I>(std::index_sequence<I...>) {
      return M(ManifoldTraits<M>::fromFactors(Factors(
          startOfMean<std::tuple_element_t<I, Factors>>(executor, detail::FactorRange<I, M, R>{samples}, weights)...)));
    }
    (std::make_index_sequence<std::tuple_size_v<Factors>>{});
  } else {
    const InstructionSet set = instructionSetOf(executor);
    if constexpr (HasChordalMoments<M>) {
      typename ManifoldTraits<M>::ChordalMoments moments;
      const std::size_t n = std::ranges::size(samples);
      if constexpr (detail::HasParameterSums<M>) {
        const std::size_t chunks = chunkCount(n);
        const auto sums = executor.reduce(
            chunks,
            [&](std::size_t chunk) {
              const ChunkRange range = chunkRange(n, chunks, chunk);
              return detail::parameterSums<M, !std::is_same_v<W, detail::UnitWeights>>(set, samples, weights,
                                                                                       range.begin, range.end);
            },
            [](auto& a, const auto& b) { a += b; });
        moments.add(sums);
      } else {
        for (std::size_t i = 0; i < n; ++i) moments.add(samples[i], S(weights[i]));
      }
      if constexpr (std::is_same_v<decltype(moments.mean()), M>) {
        return moments.mean();
      } else {
        const std::optional<M> average = moments.mean();
        return average ? *average : detail::bestOfSeveral<M>(set, samples, weights);
      }
    } else {
      return detail::bestOfSeveral<M>(set, samples, weights);
    }
  }
}

}  // namespace liestat
