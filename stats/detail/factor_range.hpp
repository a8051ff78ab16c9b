// The factors of features that are points of a product.
#pragma once

#include <lie/concepts.hpp>

#include <cstddef>
#include <ranges>
#include <tuple>
#include <type_traits>
#include <utility>

namespace liestat::detail {

/// The factors of M, as a std::tuple.
template <Factored M>
using FactorsOf = std::decay_t<decltype(ManifoldTraits<M>::factors(std::declval<const M&>()))>;

/// The I-th factors of a range of features, as they are asked for.
template <std::size_t I, Factored M, class R>
struct FactorRange {
  const R& samples;
  std::size_t size() const { return std::ranges::size(samples); }
  std::tuple_element_t<I, FactorsOf<M>> operator[](std::size_t k) const {
    return std::get<I>(ManifoldTraits<M>::factors(samples[k]));
  }
};

}  // namespace liestat::detail
