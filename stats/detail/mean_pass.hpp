// One pass of the Fréchet mean over the data: the sums at a candidate mean, in chunks combined in order.
#pragma once

#include <lie/manifold.hpp>
#include <stats/detail/compact_part.hpp>
#include <stats/detail/factor_range.hpp>
#include <stats/detail/kernel_sums.hpp>
#include <stats/detail/mean_sums.hpp>
#include <stats/detail/weights_of_one.hpp>
#include <stats/executor.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::detail {

/// Whether there is a weight for every datum.
template <class R, class W>
bool haveOneSize(const R& samples, const W& weights) {
  if constexpr (std::is_same_v<W, UnitWeights>) {
    return true;
  } else {
    return std::ranges::size(samples) == std::ranges::size(weights);
  }
}

/// Σ over the data in fixed chunks combined in order: same bits on any executor.
template <class Sums, Executor E, class Term>
Sums sumOverData(const E& executor, std::size_t n, const Term& term) {
  const std::size_t chunks = chunkCount(n);
  return executor.reduce(
      chunks,
      [&](std::size_t chunk) {
        Sums sums;
        const ChunkRange range = chunkRange(n, chunks, chunk);
        for (std::size_t i = range.begin; i < range.end; ++i) term(i, sums);
        return sums;
      },
      [](Sums& a, const Sums& b) { a += b; });
}

/// The terms of the features in a range of indices, by the manifold's own operations.
template <bool Scatter, Metric M, class R, class W>
void addTerms(const R& samples, const W& weights, const M& y, const ChunkRange& range, MeanPass<M>& pass) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  using std::sqrt;
  constexpr bool weighted = !std::is_same_v<W, UnitWeights>;
  const typename T::Group to_mean = T::placement(y).inverse();
  const TangentOf<M> metric = T::metricWeights();
  for (std::size_t i = range.begin; i < range.end; ++i) {
    const S p = S(weights[i]);
    const M at_mean = T::act(to_mean, M(samples[i]));
    const TangentOf<M> z = T::logOrigin(at_mean);
    const TangentOf<M> wz = metric.cwiseProduct(z);
    const S squared_distance = z.dot(wz);
    pass.sums.cost += S(0.5) * p * squared_distance;
    // An inverse tangent makes a finite angle of infinite numbers.
    if constexpr (requires { at_mean.params().allFinite(); }) {
      if (!at_mean.params().allFinite()) pass.sums.cost = std::numeric_limits<S>::quiet_NaN();
    }
    pass.sums.gradient += p * wz;
    pass.sums.hessian += p * T::hessianHalfSquaredDistance(z);
    pass.sums.weight += weights[i];
    if constexpr (Scatter) {
      const SquareOf<M> outer = p * z * z.transpose();
      pass.scatter.scatter += outer;
      if constexpr (weighted) pass.scatter.squared += p * outer;
      pass.scatter.largest = std::max(pass.scatter.largest, S(sqrt(squared_distance)));
      if constexpr (has_compact_factor<M>) {
        const S angle2 = z.template segment<compact_dimension<M>>(T::compact_begin).squaredNorm();
        pass.scatter.largest_angle = std::max(pass.scatter.largest_angle, S(sqrt(angle2)));
        pass.scatter.fourth += weights[i] * static_cast<double>(angle2) * static_cast<double>(angle2);
      }
      if constexpr (Quotient<M>) {
        pass.scatter.smallest_gap = std::min(pass.scatter.smallest_gap, T::nearestRepresentative(at_mean).gap());
      }
    }
  }
  if constexpr (Scatter && !weighted) pass.scatter.squared = pass.scatter.scatter;
}

template <bool Scatter, Metric M, class R, class W>
bool addTermsByPacks(InstructionSet set, const R& samples, const W& weights, const M& y, const ChunkRange& range,
                     MeanPass<M>& pass);

/// The terms of the I-th factors of products: cost, gradient and Hessian are those of the factors. The scatter is not: it
/// has blocks of two factors.
template <std::size_t I, Metric M, class R, class W>
void addTermsOfFactor(InstructionSet set, const R& samples, const W& weights, const M& y, const ChunkRange& range,
                      MeanPass<M>& pass, int& begin) {
  using Factor = std::tuple_element_t<I, FactorsOf<M>>;
  constexpr int k = ManifoldTraits<Factor>::DoF;
  const FactorRange<I, M, R> factors{samples};
  const Factor at = std::get<I>(ManifoldTraits<M>::factors(y));
  MeanPass<Factor> part;
  if (!addTermsByPacks<false>(set, factors, weights, at, range, part)) {
    part = {};
    addTerms<false>(factors, weights, at, range, part);
  }
  pass.sums.cost += part.sums.cost;
  pass.sums.gradient.template segment<k>(begin) = part.sums.gradient;
  pass.sums.hessian.template block<k, k>(begin, begin) = part.sums.hessian;
  pass.sums.weight = part.sums.weight;
  begin += k;
}

/// Products one of whose factors has a kernel.
template <class M>
constexpr bool hasFactorSums() {
  if constexpr (Factored<M>) {
    return []<class... Factor>(std::type_identity<std::tuple<Factor...>>) {
      return ((HasKernelSums<Factor> || hasFactorSums<Factor>()) || ...);
    }(std::type_identity<FactorsOf<M>>());
  } else {
    return false;
  }
}

/// The same several features at a time, to the sums of an empty pass, for the manifolds that have it. False, and nothing of
/// value in the pass, where that does not apply to the data.
template <bool Scatter, Metric M, class R, class W>
bool addTermsByPacks(InstructionSet set, const R& samples, const W& weights, const M& y, const ChunkRange& range,
                     MeanPass<M>& pass) {
  if constexpr (HasKernelSums<M>) {
    constexpr bool weighted = !std::is_same_v<W, UnitWeights>;
    return KernelSumsOf<M>::type::template add<weighted, Scatter>(set, samples, weights, range.begin, range.end, y,
                                                                  pass);
  } else if constexpr (hasFactorSums<M>() && !Scatter) {
    int begin = 0;
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      (addTermsOfFactor<I>(set, samples, weights, y, range, pass, begin), ...);
    }
    (std::make_index_sequence<std::tuple_size_v<FactorsOf<M>>>{});
    return true;
  } else {
    return false;
  }
}

template <bool Scatter, Metric M, Executor E, class R, class W>
MeanPass<M> meanPass(const E& executor, const R& samples, const W& weights, const M& y) {
  const std::size_t n = std::ranges::size(samples), chunks = chunkCount(n);
  const InstructionSet set = instructionSetOf(executor);
  MeanPass<M> pass = executor.reduce(
      chunks,
      [&](std::size_t chunk) {
        MeanPass<M> part;
        const ChunkRange range = chunkRange(n, chunks, chunk);
        if (!addTermsByPacks<Scatter>(set, samples, weights, y, range, part)) {
          part = {};
          addTerms<Scatter>(samples, weights, y, range, part);
        }
        return part;
      },
      [](MeanPass<M>& a, const MeanPass<M>& b) { a += b; });
  pass.has_scatter = Scatter;
  return pass;
}

/// One pass at a candidate mean. The one that is expected to be the last collects the scatter too.
template <Metric M, Executor E, class R, class W>
MeanPass<M> meanPass(const E& executor, const R& samples, const W& weights, const M& y, bool with_scatter) {
  return with_scatter ? meanPass<true>(executor, samples, weights, y) : meanPass<false>(executor, samples, weights, y);
}

}  // namespace liestat::detail
