// Measurements of several kinds in one list, as std::variant: a channel for each alternative, with its own type, size and
// measurement equations. The models of a hierarchy (stats/hierarchy.hpp) over such measurements take them apart by
// byChannel(); their own equationsOf() says how many equations a measurement has.
#pragma once

#include <cstddef>
#include <span>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

namespace liestat {

namespace detail {

/// A measurement of one kind has one channel, a variant one for each alternative.
template <class M>
struct ChannelsOf {
  static constexpr std::size_t count = 1;
  template <std::size_t>
  using Type = M;
  static std::size_t of(const M&) { return 0; }
  template <std::size_t>
  static const M& make(const M& value) {
    return value;
  }
};
template <class... C>
struct ChannelsOf<std::variant<C...>> {
  static constexpr std::size_t count = sizeof...(C);
  template <std::size_t I>
  using Type = std::variant_alternative_t<I, std::variant<C...>>;
  static std::size_t of(const std::variant<C...>& m) { return m.index(); }
  template <std::size_t I>
  static std::variant<C...> make(const Type<I>& value) {
    return std::variant<C...>(std::in_place_index<I>, value);
  }
};

}  // namespace detail

/// The measurements of each channel, in their order: how a model gives them to constrainedEstimate().
template <class... C>
std::tuple<std::vector<C>...> byChannel(std::span<const std::variant<C...>> mixed) {
  std::tuple<std::vector<C>...> channels;
  const auto put = [&channels]<std::size_t... I>(const auto& m, std::index_sequence<I...>) {
    const auto put_one = [](auto& channel, const auto* value) {
      if (value) channel.push_back(*value);
    };
    (put_one(std::get<I>(channels), std::get_if<I>(&m)), ...);
  };
  for (const auto& m : mixed) put(m, std::index_sequence_for<C...>{});
  return channels;
}

}  // namespace liestat
