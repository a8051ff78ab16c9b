// Where the compact part of a manifold stands in its tangent vectors, for what looks at it alone.
#pragma once

#include <lie/manifold.hpp>
#include <stats/start.hpp>

#include <cstddef>
#include <tuple>
#include <utility>

namespace liestat::detail {

/// True if the traits of M itself, which is no product, say which compact space it turns on.
template <Homogeneous M>
inline constexpr bool has_compact_factor =
    compactFactor<M>() != CompactFactor::none&& compactFactor<M>() != CompactFactor::unknown;

/// The dimension of that space.
template <Homogeneous M>
inline constexpr int compact_dimension = compactFactor<M>() == CompactFactor::rotation ? 3
                                         : compactFactor<M>() == CompactFactor::sphere ? 2
                                                                                       : 1;

/// Where the I-th factor's coordinates begin in a tangent vector.
template <std::size_t I, Homogeneous M>
constexpr int factorOffset() {
  return []<std::size_t... K>(std::index_sequence<K...>) {
    return (0 + ... + ManifoldTraits<std::tuple_element_t<K, FactorsOf<M>>>::DoF);
  }
  (std::make_index_sequence<I>{});
}

}  // namespace liestat::detail
