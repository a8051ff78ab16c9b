// The representatives of a product of features of which some are quotients.
#pragma once

#include <lie/detail/part_tuple.hpp>
#include <lie/detail/trig.hpp>

#include <array>
#include <cstddef>
#include <iterator>
#include <limits>

namespace liestat::detail {

/// How many representatives a feature has: one unless it is a quotient's.
template <class M>
constexpr int representativeCount() {
  if constexpr (Quotient<M>) {
    return static_cast<int>(std::size(ManifoldTraits<M>::representatives));
  } else {
    return 1;
  }
}

/// The nearest representative of a product, and how far the product is from its cut locus.
template <class Scalar>
struct ProductRepresentative {
  int index = 0;
  Scalar min_gap = std::numeric_limits<double>::infinity();
  Scalar gap() const { return min_gap; }  ///< the least of the quotient parts', rad
};

/// Representatives of a product with a quotient among its parts. An index has one digit a part, the first part's
/// lowest: the position in that part's list.
template <class M, class... Ms>
struct ProductRepresentatives {
  static constexpr int num_representatives = (representativeCount<Ms>() * ...);
  static constexpr std::array<int, static_cast<std::size_t>(num_representatives)> representatives = [] {
    std::array<int, static_cast<std::size_t>(num_representatives)> list{};
    for (int i = 0; i < num_representatives; ++i) list[static_cast<std::size_t>(i)] = i;
    return list;
  }();
  template <std::size_t I>
  static constexpr int place_value = [] {
    const int counts[] = {representativeCount<Ms>()...};
    int value = 1;
    for (std::size_t k = 0; k < I; ++k) value *= counts[k];
    return value;
  }();
  template <std::size_t I>
  static constexpr int digit(int index) {
    return index / place_value<I> % representativeCount<std::tuple_element_t<I, std::tuple<Ms...>>>();
  }

  static auto nearestRepresentative(const M& x) {
    ProductRepresentative<typename M::Scalar> choice;
    forEachIndex<sizeof...(Ms)>([&](auto i) {
      using P = std::tuple_element_t<i, std::tuple<Ms...>>;
      if constexpr (Quotient<P>) {
        const auto part = ManifoldTraits<P>::nearestRepresentative(x.template get<i>());
        const typename M::Scalar gap = part.gap();
        choice.min_gap = select(gap < choice.min_gap, gap, choice.min_gap);
        for (int d = 0; d < representativeCount<P>(); ++d) {
          if (ManifoldTraits<P>::representatives[d] == part.index) choice.index += d * place_value<i>;
        }
      }
    });
    return choice;
  }
  static M representative(const M& x, int index) {
    M y = x;
    forEachIndex<sizeof...(Ms)>([&](auto i) {
      using P = std::tuple_element_t<i, std::tuple<Ms...>>;
      if constexpr (Quotient<P>) {
        using T = ManifoldTraits<P>;
        y.template get<i>() = T::representative(x.template get<i>(), T::representatives[digit<i>(index)]);
      }
    });
    return y;
  }
  static typename M::Square representativeJacobian(int index) {
    return blockDiagonal<typename M::Scalar>(typename M::Sizes{}, typename M::Sizes{}, [&](auto i) {
      using P = std::tuple_element_t<i, std::tuple<Ms...>>;
      if constexpr (Quotient<P>) {
        return ManifoldTraits<P>::representativeJacobian(ManifoldTraits<P>::representatives[digit<i>(index)]);
      } else {
        return SquareOf<P>(SquareOf<P>::Identity());
      }
    });
  }
};
struct NoRepresentatives {};

}  // namespace liestat::detail
