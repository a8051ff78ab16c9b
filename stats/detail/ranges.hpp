// What the estimators take as data: any range that can be gone through more than once, of points of a manifold or of what
// stands for them (PointTraits in lie/manifold.hpp), and any such range of numbers as weights.
//
// The kernels want random access to owning types. A random-access range of lvalues of such a type is used where it is
// (std::vector, std::array, std::span, std::deque, a view of one); everything else is copied once: std::list, the columns
// of a matrix, views that compute their elements, ranges of Eigen::Map or of Eigen::Quaternion.
#pragma once

#include <lie/manifold.hpp>
#include <stats/executor.hpp>

#include <concepts>
#include <cstddef>
#include <ranges>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

/// Ranges as a for-loop sees them: Eigen's iterators over the columns of a matrix are not std::ranges' iterators.
template <class R>
using ElementOf = decltype(*std::declval<const R&>().begin());
template <class R>
struct RangeTraits {};
template <class R>
  requires requires(const R& range) {
    *range.begin();
    range.begin() != range.end();
  }
struct RangeTraits<R> {
  using Element = ElementOf<R>;
};
template <class T, std::size_t N>
struct RangeTraits<T[N]> {
  using Element = const T&;
};

/// Input iterators end with the first pass: an estimator needs several.
template <class R>
inline constexpr bool is_single_pass = std::ranges::input_range<const R> && !std::ranges::forward_range<const R> &&
                                       std::is_base_of_v<std::ranges::view_base, R>;

}  // namespace detail

/// The manifold whose points a range holds or stands for: its owning type.
template <class R>
using SampleOf = PointOf<typename detail::RangeTraits<std::remove_cvref_t<R>>::Element>;

/// A range of points of a manifold, or of values that stand for them.
template <class R>
concept SampleRange = requires {
  typename SampleOf<R>;
}
&&Homogeneous<SampleOf<R>> && !detail::is_single_pass<std::remove_cvref_t<R>>;

/// A range of numbers, one for each point.
template <class W>
concept WeightRange = requires {
  typename detail::RangeTraits<std::remove_cvref_t<W>>::Element;
}
&&std::is_arithmetic_v<std::remove_cvref_t<typename detail::RangeTraits<std::remove_cvref_t<W>>::Element>>;

namespace detail {

/// Random access to lvalues of type T where they are.
template <class R, class T>
concept InPlace = std::ranges::random_access_range<const R> && std::ranges::sized_range<const R> &&
    std::is_lvalue_reference_v<std::ranges::range_reference_t<const R>> &&
    std::same_as<std::ranges::range_value_t<const R>, T>;

template <class R>
std::size_t sizeHint(const R& range) {
  if constexpr (requires { range.size(); }) {
    return static_cast<std::size_t>(range.size());
  } else {
    return 0;
  }
}

/// The points of a range for the estimators: the range itself where they can work on it, else a std::vector.
template <SampleRange R>
decltype(auto) asSamples(const R& range) {
  using M = SampleOf<R>;
  if constexpr (InPlace<R, M>) {
    return (range);
  } else {
    std::vector<M> samples;
    samples.reserve(sizeHint(range));
    for (auto&& x : range) samples.push_back(PointTraits<std::remove_cvref_t<decltype(x)>>::from(x));
    return samples;
  }
}

/// The weights of a range for the estimators: the range itself where they can work on it, else a std::vector.
template <WeightRange W>
decltype(auto) asWeights(const W& range) {
  using S = std::remove_cvref_t<typename RangeTraits<W>::Element>;
  if constexpr (InPlace<W, S>) {
    return (range);
  } else {
    std::vector<S> weights;
    weights.reserve(sizeHint(range));
    for (const S& w : range) weights.push_back(w);
    return weights;
  }
}

/// What the functions that catch a wrong first argument say, in one sentence.
template <class... A>
inline constexpr bool always_false = false;

}  // namespace detail
}  // namespace liestat
