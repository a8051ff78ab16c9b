// Ranges that the estimators accept as data: any that can be gone through more than once, of points of a manifold or of
// values that stand for them (PointTraits in lie/manifold.hpp), and any such range of numbers as weights.
//
// The estimators themselves see one type, Samples: random access to owning types, indexed by any integer. Values of
// such a type in random-access memory are used where they are (std::vector, std::array, std::span, std::deque, a view
// of one), and so are the elements of a Strided<M> (lie/array_view.hpp), a column of a table. Everything else is
// copied once: std::list, the columns of a matrix, views that compute their elements, ranges of Eigen::Map or of
// Eigen::Quaternion, weights that are not double.
#pragma once

#include <lie/manifold.hpp>
#include <lie/so3.hpp>

#include <concepts>
#include <cstddef>
#include <iterator>
#include <memory>
#include <ranges>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

/// Whatever a range-based for loop goes through.
template <class R>
concept AnyRange = requires(std::remove_reference_t<R>& range) {
  *std::begin(range);
  std::begin(range) != std::end(range);
};

/// Whatever a range-based for loop goes through more than once.
template <class R>
concept MultiPass = AnyRange<R> &&(!std::ranges::input_range<R> || std::ranges::forward_range<R>);

template <AnyRange R>
using ElementOf = std::remove_cvref_t<decltype(*std::begin(std::declval<std::remove_reference_t<R>&>()))>;

}  // namespace detail

/// The manifold whose points a range holds or stands for: its owning type.
template <detail::AnyRange R>
using SampleOf = PointOf<detail::ElementOf<R>>;

/// A multi-pass range of points of a manifold, or of values that stand for them.
template <class R>
concept SampleRange = detail::MultiPass<R> && requires {
  typename SampleOf<R>;
} && Homogeneous<SampleOf<R>>;

/// A multi-pass range of numbers, one for each point.
template <class W>
concept WeightRange = detail::MultiPass<W> && std::is_arithmetic_v<detail::ElementOf<W>>;

namespace detail {

/// Values of type T for the estimators: a view of memory, or the owner of a copy. Moves, but is not copied.
template <class T, class Iterator = const T*>
class Samples {
 public:
  Samples(Iterator begin, std::size_t size) : begin_(begin), size_(size) {}
  explicit Samples(std::vector<T> values) requires std::same_as<Iterator, const T*>
      : values_(std::move(values)), begin_(values_.data()), size_(values_.size()) {}
  Samples(Samples&&) noexcept = default;
  Samples& operator=(Samples&&) noexcept = default;

  std::size_t size() const { return size_; }
  Iterator begin() const { return begin_; }
  Iterator end() const { return begin_ + static_cast<std::ptrdiff_t>(size_); }
  const T& operator[](std::integral auto i) const { return begin_[static_cast<std::ptrdiff_t>(i)]; }

 private:
  std::vector<T> values_;
  Iterator begin_;
  std::size_t size_;
};

/// Random access to lvalues of type T, where they are.
template <class R, class T>
concept InPlace = std::ranges::random_access_range<R> && std::ranges::sized_range<R> &&
    std::is_lvalue_reference_v<std::ranges::range_reference_t<R>> &&
    std::same_as<std::remove_cvref_t<std::ranges::range_reference_t<R>>, T>;

/// The elements of a range as values of type T: where they are, else copied through `convert`.
template <class T, MultiPass R, class Convert>
auto inPlaceOrCopied(R& range, Convert&& convert) {
  if constexpr (InPlace<R, T>) {
    const auto size = static_cast<std::size_t>(std::ranges::size(range));
    if constexpr (std::ranges::contiguous_range<R>) {
      return Samples<T>(std::to_address(std::ranges::begin(range)), size);
    } else if constexpr (InPlace<const R, T>) {
      return Samples<T, std::ranges::iterator_t<const R>>(std::ranges::begin(std::as_const(range)), size);
    } else {
      return Samples<T, std::ranges::iterator_t<R>>(std::ranges::begin(range), size);
    }
  } else {
    std::vector<T> values;
    if constexpr (requires { static_cast<std::size_t>(range.size()); }) {
      values.reserve(static_cast<std::size_t>(range.size()));
    }
    for (auto&& x : range) values.push_back(convert(x));
    return Samples<T>(std::move(values));
  }
}

/// A Strided<T>: kernels read its memory, the rest copies its elements one by one.
template <class R, class T>
concept StridedInMemory = std::same_as<std::ranges::range_value_t<R>, T> && requires(const R& range) {
  range.layout();
};

/// The points of a range for the estimators, of type Samples<SampleOf<R>, …> or a Strided<SampleOf<R>>. The range must
/// outlive them.
template <SampleRange R>
auto asSamples(R& range) {
  if constexpr (StridedInMemory<R, SampleOf<R>>)
    return std::remove_const_t<R>(range);
  else
    return inPlaceOrCopied<SampleOf<R>>(
        range, [](const auto& x) -> SampleOf<R> { return PointTraits<std::remove_cvref_t<decltype(x)>>::from(x); });
}

/// The weights of a range for the estimators, of type Samples<double, …>. The range must outlive them.
template <WeightRange W>
auto asWeights(W& range) {
  return inPlaceOrCopied<double>(range, [](const auto& x) { return static_cast<double>(x); });
}

/// Values of type T, or such as convert to it, for the estimators: matrices, features with their covariance.
template <class T, MultiPass R>
auto asValues(R& range) {
  return inPlaceOrCopied<T>(range, [](const auto& x) { return T(x); });
}

/// States in one sentence what is wrong with a range of points; `ok` where nothing is.
template <AnyRange R>
struct RequireSamples {
  static constexpr bool ok = SampleRange<R>;
  static_assert(MultiPass<R>, "liestat: the data can be gone through only once; copy them into a std::vector first.");
  static_assert(!MultiPass<R> || ok,
                "liestat: the elements of the data are no points of a manifold; an estimator takes SO3d, Frame3d, "
                "Vector3d …, views of them, unit quaternions, or a type with ManifoldTraits or PointTraits.");
};

/// The same of weights.
template <AnyRange W>
struct RequireWeights {
  static constexpr bool ok = WeightRange<W>;
  static_assert(ok,
                "liestat: weights are a range of numbers that can be gone through more than once, one number for "
                "each datum.");
};

/// SampleOf, for signatures: something that compiles where RequireSamples says what is wrong.
template <AnyRange R>
struct SampleOrStandIn {
  using type = SO3<double>;
};
template <SampleRange R>
struct SampleOrStandIn<R> {
  using type = SampleOf<R>;
};
template <class R>
using SampleInSignature = typename SampleOrStandIn<R>::type;

}  // namespace detail
}  // namespace liestat
