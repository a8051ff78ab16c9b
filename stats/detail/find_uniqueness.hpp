// Which certificate of stats/uniqueness.hpp serves a manifold: by the factors of a product, else by the compact factor
// that its traits say, else by distances alone.
#pragma once

#include <stats/detail/compact_part.hpp>
#include <stats/detail/searched_manifold.hpp>
#include <stats/detail/sum_certificates.hpp>
#include <stats/detail/uniqueness_circle.hpp>
#include <stats/mean.hpp>

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

/// The mean of the I-th factors: their part of a mean, from which it starts.
template <std::size_t I, Metric M, Executor E, class R, class W>
auto factorMean(const E& executor, const R& samples, const W& weights, const MeanResult<M>& mean) {
  using F = std::tuple_element_t<I, FactorsOf<M>>;
  MeanOptions<F> options;
  options.start = std::get<I>(ManifoldTraits<M>::factors(mean.mean));
  return frechetMean<F>(executor, FactorRange<I, M, R>{samples}, weights, options);
}

/// On a flat manifold there is nothing to look for.
template <Metric M>
void provesFlat(UniquenessResult<M>& result) {
  result.r_star = std::numeric_limits<double>::infinity();
  result.unique = Uniqueness::unique;
  result.proof = "the manifold is flat";
}

template <Metric M, Executor E, class R, class W>
UniquenessResult<M> findUniqueness(const E& executor, const R& samples, const W& weights, const MeanResult<M>& mean,
                                   const UniquenessOptions& options);

/// The criterion of a product is a sum of its factors', each of which has its own variable: the minima of the product
/// are the tuples of the factors' minima.
template <Metric M, Executor E, class R, class W>
UniquenessResult<M> uniquenessByFactors(const E& executor, const R& samples, const W& weights,
                                        const MeanResult<M>& mean, const UniquenessOptions& options) {
  using Factors = FactorsOf<M>;
  constexpr std::size_t n = std::tuple_size_v<Factors>;
  UniquenessResult<M> result;
  Factors best = ManifoldTraits<M>::factors(mean.mean);
  const auto rivals_of = [&]<std::size_t... I>(std::index_sequence<I...>) {
    return std::tuple<std::vector<std::tuple_element_t<I, Factors>>...>{};
  };
  auto rivals = rivals_of(std::make_index_sequence<n>{});
  bool certified = true, ambiguous = false, improved = false;
  result.cost = 0;
  result.r_star = std::numeric_limits<double>::infinity();
  forEachIndex<n>([&](auto i) {
    const FactorRange<i, M, R> factors{samples};
    const auto part =
        findUniqueness(executor, factors, weights, factorMean<i>(executor, samples, weights, mean), options);
    std::get<i>(best) = part.minimiser;
    std::get<i>(rivals) = part.rivals;
    certified = certified && part.unique != Uniqueness::not_certified;
    ambiguous = ambiguous || part.unique == Uniqueness::ambiguous;
    improved = improved || part.improved;
    result.more_rivals = result.more_rivals || part.more_rivals;
    result.cost += part.cost;
    result.r_star = std::min(result.r_star, part.r_star);
    result.cells += part.cells;
  });
  result.minimiser = ManifoldTraits<M>::fromFactors(best);
  result.improved = improved || (!converged(mean.status) && result.cost < mean.cost);
  // Two minima of one factor make two of the product, whatever else there may be.
  result.unique = ambiguous ? Uniqueness::ambiguous : certified ? Uniqueness::unique : Uniqueness::not_certified;
  if (ambiguous) result.proof = "a factor has several minima of equal cost";
  if (result.unique == Uniqueness::unique) result.proof = "each factor's minimum is the only one";
  std::vector<Factors> minima{best};
  forEachIndex<n>([&](auto i) {
    const std::size_t so_far = minima.size();
    for (const auto& rival : std::get<i>(rivals)) {
      for (std::size_t k = 0; k < so_far && minima.size() <= options.max_rivals; ++k) {
        minima.push_back(minima[k]);
        std::get<i>(minima.back()) = rival;
      }
    }
  });
  std::size_t tuples = 1;
  forEachIndex<n>([&](auto i) { tuples *= 1 + std::get<i>(rivals).size(); });
  result.more_rivals = result.more_rivals || minima.size() < tuples;
  for (std::size_t k = 1; k < minima.size(); ++k) {
    result.rivals.push_back(ManifoldTraits<M>::fromFactors(minima[k]));
  }
  return result;
}

template <Metric M, Executor E, class R, class W>
UniquenessResult<M> findUniqueness(const E& executor, const R& samples, const W& weights, const MeanResult<M>& mean,
                                   const UniquenessOptions& options) {
  eigen_assert(haveOneSize(samples, weights));
  UniquenessResult<M> result;
  result.minimiser = mean.mean;
  result.cost = mean.cost;
  using std::isfinite;
  const std::size_t n = std::ranges::size(samples);
  if (n == 0 || !isfinite(static_cast<double>(mean.cost))) return result;
  if constexpr (Factored<M>) {
    return uniquenessByFactors(executor, samples, weights, mean, options);
  } else if constexpr (compactFactor<M>() == CompactFactor::none) {
    provesFlat(result);
    return result;
  } else if constexpr (compactFactor<M>() == CompactFactor::circle) {
    if (isUniqueBySums(mean, options.tie_tolerance, result)) return result;
    return circleUniqueness(executor, samples, weights, mean, options);
  } else if constexpr (compactFactor<M>() == CompactFactor::unknown) {
    // A user's manifold: the theorem holds for its whole distance.
    if (converged(mean.status) && static_cast<double>(mean.largest_distance) < aPrioriRadius(mean.mean) * (1 - 1e-9)) {
      result.unique = Uniqueness::unique;
      result.proof = "the data lie in a ball about the mean that is small enough";
    }
    return result;
  } else {
    if (isUniqueBySums(mean, options.tie_tolerance, result)) return result;
    using Space = decltype(searchSpace(mean.mean));
    return SearchedManifold<M, Space, E, R, W>(executor, samples, weights, mean).certify(options);
  }
}

template <Metric M, class R, class W>
double findLocalRadius(const R& samples, const W& weights, const M& mean) {
  eigen_assert(haveOneSize(samples, weights));
  if constexpr (Factored<M>) {
    double least = std::numeric_limits<double>::infinity();
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      const auto factor = std::get<i>(ManifoldTraits<M>::factors(mean));
      least = std::min(least, findLocalRadius(FactorRange<i, M, R>{samples}, weights, factor));
    });
    return least;
  } else if constexpr (compactFactor<M>() == CompactFactor::none) {
    return std::numeric_limits<double>::infinity();
  } else if constexpr (compactFactor<M>() == CompactFactor::circle) {
    double largest = 0;
    const auto to_mean = ManifoldTraits<M>::placement(mean).inverse();
    for (std::size_t i = 0; i < std::ranges::size(samples); ++i) {
      largest = std::max(largest, std::abs(relativeAngle(to_mean, M(samples[i]))));
    }
    return pi - largest;
  } else {
    static_assert(compactFactor<M>() != CompactFactor::unknown,
                  "localRadius asks the traits of the manifold for their compact_factor");
    const auto space = searchSpace(mean);
    using Space = decltype(searchSpace(mean));
    return convexityRadius<Space>(profile(pack(space, samples, weights, mean), Space::fromChart(Space::Chart::Zero())));
  }
}

}  // namespace liestat::detail
