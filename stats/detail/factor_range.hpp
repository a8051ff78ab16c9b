// The factors of features that are points of a product.
#pragma once

#include <lie/concepts.hpp>
#include <stats/detail/feature_layout.hpp>

#include <cstddef>
#include <functional>
#include <memory>
#include <ranges>
#include <tuple>
#include <type_traits>
#include <utility>

namespace liestat::detail {

/// The factors of M, as a std::tuple.
template <Factored M>
using FactorsOf = std::decay_t<decltype(ManifoldTraits<M>::factors(std::declval<const M&>()))>;

/// Factors that are parts of the features in memory, or of what these refer to.
template <class M>
concept RefersToFactors = Factored<M> && requires(const M& x) {
  { ManifoldTraits<M>::factors(x) } -> std::same_as<const FactorsOf<M>&>;
};

/// The I-th factors of a range of features, as they are asked for.
template <std::size_t I, Factored M, class R>
struct FactorRange {
  using Factor = std::tuple_element_t<I, FactorsOf<M>>;
  using S = typename ManifoldTraits<M>::Scalar;

  const R& samples;
  std::size_t size() const { return std::ranges::size(samples); }
  Factor operator[](std::size_t k) const { return std::get<I>(ManifoldTraits<M>::factors(samples[k])); }
  /// The parameters of the factors from the k-th feature on, if they lie in the features at equal distances; else no data.
  Layout<const S> layoutFrom(std::size_t k) const
      requires(RefersToFactors<M>&& ContiguousFeatures<R, M>&& HasParameterMemory<Factor> &&
               sizeof(M) % sizeof(S) == 0) {
    const M* const feature = std::to_address(std::ranges::begin(samples)) + k;
    const S* const first = parametersOf(std::get<I>(ManifoldTraits<M>::factors(*feature)));
    const auto* const begin = reinterpret_cast<const S*>(feature);
    constexpr std::less<const S*> before;
    const bool inside = !before(first, begin) && before(first, begin + sizeof(M) / sizeof(S));
    constexpr std::size_t element = sizeof(M) / sizeof(S);
    return {inside ? first : nullptr, element, 1, readAhead<S>(size() * element)};
  }
};

}  // namespace liestat::detail
