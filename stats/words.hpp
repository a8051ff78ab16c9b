// Numbers and enumerators in the sentences of results and in files. (Needs the standard library alone.)
//
//   enum class PairsModel { independent, chain };
//   constexpr auto words(PairsModel) { return std::array{"independent", "chain"}; }
//   …
//   name(PairsModel::chain)         // "chain"
//   named<PairsModel>("chain")      // PairsModel::chain; nothing where no enumerator has the name
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <optional>
#include <string>
#include <string_view>

namespace liestat {

/// A number for people, with so many significant digits; `n/a` for what is not finite.
inline std::string significant(double value, int digits = 4) {
  if (!std::isfinite(value)) return "n/a";
  char text[64];
  std::snprintf(text, sizeof text, "%.*g", digits < 1 ? 1 : digits > 17 ? 17 : digits, value);
  return text;
}

/// An enumeration with a word for each enumerator, words(E), in their order from 0.
template <class E>
concept Worded = requires(E e) {
  words(e)[0];
};

/// The enumerator's word, for files, options and sentences.
template <Worded E>
constexpr const char* name(E e) {
  return words(e)[static_cast<std::size_t>(e)];
}
/// The enumerator with this word; nothing if there is none.
template <Worded E>
constexpr std::optional<E> named(std::string_view word) {
  const auto all = words(E{});
  for (std::size_t k = 0; k < all.size(); ++k) {
    if (word == all[k]) return static_cast<E>(k);
  }
  return std::nullopt;
}

}  // namespace liestat
