// Arrays of elements where they are, without a copy: arrays of SO3d, SE3d, Vector3d …, structures of arrays, a column
// of poses inside a user's struct, matrices of Eigen with an element in each column or row.
//
//   std::vector<SE3d> poses;                       ArrayView<double> a(poses);
//   Eigen::Matrix<double, 4, Eigen::Dynamic> q;    ArrayView<double> b(q);           an element in each column
//   Eigen::MatrixXd m;                             ArrayView<double> c = rowsOf(m);  an element in each row
//   struct Row { double time; SE3d pose; };
//   std::vector<Row> log;                          ArrayView<double> d = memberOf(log, &Row::pose);
//   double *numbers;                               ArrayView<double> e(numbers, n, 7), soa(numbers, n, 1, n);
//
// Operations over them are in lie/arrays.hpp; Strided<M> makes a range of elements of one, for mean() and the other
// estimators. A view owns nothing: what it shows must outlive it.
#pragma once

#include <lie/detail/columns.hpp>
#include <lie/detail/finite_math.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <array>
#include <compare>
#include <concepts>
#include <cstddef>
#include <functional>
#include <iterator>
#include <ranges>
#include <type_traits>

namespace liestat {

template <class T>
class ArrayView;

namespace detail {

/// The place of an element's numbers, X its type, for types that hold nothing else.
template <class X>
struct ElementNumbers;
template <class X>
  requires std::same_as<X, float> || std::same_as<X, double>
struct ElementNumbers<X> {
  using Scalar = X;
  static constexpr std::size_t count = 1;
  static constexpr bool by_rows = false;
  static auto* data(auto& x) { return &x; }
};
template <class S, std::size_t N>
struct ElementNumbers<std::array<S, N>> {
  using Scalar = S;
  static constexpr std::size_t count = N;
  static constexpr bool by_rows = false;
  static auto* data(auto& x) { return x.data(); }
};
template <class S, int Options>
struct ElementNumbers<Eigen::Quaternion<S, Options>> {
  using Scalar = S;
  static constexpr std::size_t count = 4;
  static constexpr bool by_rows = false;
  static auto* data(auto& x) { return x.coeffs().data(); }
};
template <class S, int Rows, int Columns, int Options>
  requires(Rows > 0 && Columns > 0)
struct ElementNumbers<Eigen::Matrix<S, Rows, Columns, Options>> {
  using Scalar = S;
  static constexpr std::size_t count = Rows * Columns;
  static constexpr bool by_rows = (Options & Eigen::RowMajor) != 0 && Rows > 1 && Columns > 1;
  static auto* data(auto& x) { return x.data(); }
};
/// The library's types.
template <class X>
  requires requires { X::fromParams(typename X::Params()); }
struct ElementNumbers<X> {
  using Scalar = typename X::Scalar;
  static constexpr std::size_t count = static_cast<std::size_t>(X::num_parameters);
  static constexpr bool by_rows = false;
  static auto* data(auto& x) { return x.data(); }
};

/// A type that holds the numbers of one element, of scalar S.
template <class X, class S>
concept ElementOfNumbers = requires {
  typename ElementNumbers<std::remove_const_t<X>>::Scalar;
}
&&std::same_as<typename ElementNumbers<std::remove_const_t<X>>::Scalar, std::remove_const_t<S>> &&
    (std::is_const_v<S> || !std::is_const_v<X>);

/// An array of them, one behind the other.
template <class R, class T>
concept ContiguousElements = std::ranges::contiguous_range<R> && std::ranges::sized_range<R> &&
                             ElementOfNumbers<std::remove_reference_t<std::ranges::range_reference_t<R>>, T> &&
                             !std::derived_from<std::remove_cvref_t<R>, Eigen::EigenBase<std::remove_cvref_t<R>>> &&
                             !ElementOfNumbers<std::remove_cvref_t<R>, const std::remove_const_t<T>>;

/// A matrix of Eigen in memory, or a view of one, that outlives an expression.
template <class D>
concept MatrixInMemory = std::derived_from<std::remove_cvref_t<D>, Eigen::DenseBase<std::remove_cvref_t<D>>> &&
    (std::is_lvalue_reference_v<D> ||
     !std::derived_from<std::remove_cvref_t<D>, Eigen::PlainObjectBase<std::remove_cvref_t<D>>>)&&requires(D& m) {
  m.data(), m.innerStride(), m.outerStride();
};
/// double or const double.
template <class D>
using NumberOf = std::remove_pointer_t<decltype(std::declval<D&>().data())>;
/// Its elements are its columns or its rows: the other number is fixed.
template <class D, class T>
concept MatrixOfElements = MatrixInMemory<D> && std::convertible_to < NumberOf<D>
*, T* > &&(std::remove_cvref_t<D>::RowsAtCompileTime == Eigen::Dynamic) !=
       (std::remove_cvref_t<D>::ColsAtCompileTime == Eigen::Dynamic);

}  // namespace detail

/// `size` elements of T, double or float, const or not: number c of element i is
/// data[i element_stride + c component_stride]; strides are counted in numbers and may have any sign. An element that
/// is a matrix has its numbers by columns unless byRows() says otherwise.
template <class T>
class ArrayView {
 public:
  using Scalar = std::remove_const_t<T>;
  static_assert(std::same_as<Scalar, double> || std::same_as<Scalar, float>,
                "liestat: an ArrayView is one of double or float");

  ArrayView() = default;
  /// components: how many numbers an element has, for the operations' assertions; 0 leaves them out.
  ArrayView(T* data, std::size_t size, std::ptrdiff_t element_stride, std::ptrdiff_t component_stride = 1,
            std::size_t components = 0)
      : layout_{data, element_stride, component_stride, 0}, size_(size), components_(components) {}
  /// The same memory, to read.
  template <class U>
    requires(std::is_const_v<T>&& std::is_same_v<U, Scalar>)
  ArrayView(const ArrayView<U>& other)  // NOLINT: implicit
      : ArrayView(other.layout().data, other.size(), other.layout().element, other.layout().component,
                  other.components()) {
    by_rows_ = other.hasRows();
  }
  /// An array, vector, span … of the library's types, of fixed-size Eigen vectors, matrices or quaternions, of
  /// std::array, or of numbers, which are elements of one number.
  template <detail::ContiguousElements<T> R>
    requires(std::is_lvalue_reference_v<R> || std::ranges::borrowed_range<R>)
  ArrayView(R&& elements)  // NOLINT: implicit, as of std::span
      : ArrayView(std::ranges::empty(elements) ? ArrayView(nullptr, 0, 0)
                                               : ofElement(*std::ranges::data(elements), std::ranges::size(elements))) {
  }
  /// One element. Operations take it for every element of their other operand.
  template <detail::ElementOfNumbers<T> X>
  ArrayView(X& element) : ArrayView(ofElement(element, 1)) {}  // NOLINT: implicit
  /// The columns of a 4×n matrix, the rows of an n×4 matrix: a Matrix, Map, Ref or Block of Eigen in memory. Where both
  /// numbers are dynamic, columnsOf() and rowsOf() tell.
  template <detail::MatrixOfElements<T> D>
  ArrayView(D&& m);  // NOLINT: implicit

  std::size_t size() const { return size_; }
  /// The number of numbers in an element; 0 where the view was not told.
  std::size_t components() const { return components_; }
  const detail::Layout<T>& layout() const { return layout_; }
  T& operator()(std::size_t element, std::size_t component) const { return *layout_.at(element, component); }
  /// The elements begin … begin + size - 1.
  ArrayView subview(std::size_t begin, std::size_t size) const {
    eigen_assert(begin <= size_ && size <= size_ - begin);
    ArrayView part = *this;
    if (size != 0) part.layout_.data = layout_.at(begin, 0);
    part.size_ = size;
    return part;
  }
  /// Elements are matrices that have their numbers by rows, as in C and NumPy.
  ArrayView byRows() const {
    ArrayView view = *this;
    view.by_rows_ = true;
    return view;
  }
  bool hasRows() const { return by_rows_; }

 private:
  template <class X>
  static ArrayView ofElement(X& first, std::size_t size) {
    using Numbers = detail::ElementNumbers<std::remove_const_t<X>>;
    static_assert(sizeof(X) % sizeof(T) == 0);
    const ArrayView view(Numbers::data(first), size, sizeof(X) / sizeof(T), 1, Numbers::count);
    return Numbers::by_rows ? view.byRows() : view;
  }

  detail::Layout<T> layout_;
  std::size_t size_ = 0, components_ = 0;
  bool by_rows_ = false;
};

/// The columns of a matrix of Eigen as elements.
template <detail::MatrixInMemory D>
auto columnsOf(D&& m) {
  constexpr bool row_major = std::remove_cvref_t<D>::IsRowMajor;
  const auto inner = static_cast<std::ptrdiff_t>(m.innerStride()), outer = static_cast<std::ptrdiff_t>(m.outerStride());
  return ArrayView<detail::NumberOf<D>>(m.data(), static_cast<std::size_t>(m.cols()), row_major ? inner : outer,
                                        row_major ? outer : inner, static_cast<std::size_t>(m.rows()));
}
/// The rows of a matrix of Eigen as elements.
template <detail::MatrixInMemory D>
auto rowsOf(D&& m) {
  constexpr bool row_major = std::remove_cvref_t<D>::IsRowMajor;
  const auto inner = static_cast<std::ptrdiff_t>(m.innerStride()), outer = static_cast<std::ptrdiff_t>(m.outerStride());
  return ArrayView<detail::NumberOf<D>>(m.data(), static_cast<std::size_t>(m.rows()), row_major ? outer : inner,
                                        row_major ? inner : outer, static_cast<std::size_t>(m.cols()));
}

template <class T>
template <detail::MatrixOfElements<T> D>  // NOLINTNEXTLINE(bugprone-forwarding-reference-overload): no view is a matrix
ArrayView<T>::ArrayView(D&& m) {
  if constexpr (std::remove_cvref_t<D>::ColsAtCompileTime == Eigen::Dynamic) {
    *this = columnsOf(m);
  } else {
    *this = rowsOf(m);
  }
}

/// One member of each struct in an array: memberOf(log, &Row::pose), or a function that returns a reference to it.
template <std::ranges::contiguous_range R, class Member>
auto memberOf(R&& rows, Member member) {
  using Row = std::remove_reference_t<std::ranges::range_reference_t<R>>;
  using Reference = std::invoke_result_t<Member, Row&>;
  using X = std::remove_reference_t<Reference>;
  using S = typename detail::ElementNumbers<std::remove_const_t<X>>::Scalar;
  using View = ArrayView<std::conditional_t<std::is_const_v<X>, const S, S>>;
  static_assert(std::is_lvalue_reference_v<R> || std::ranges::borrowed_range<R>, "liestat: a view of a temporary");
  static_assert(std::is_lvalue_reference_v<Reference>, "liestat: memberOf takes what leads to a member in memory");
  static_assert(sizeof(Row) % sizeof(S) == 0, "liestat: the members are not at a distance of whole numbers");
  const std::size_t n = std::ranges::size(rows);
  if (n == 0) return View(nullptr, 0, 0);
  const View first(std::invoke(member, *std::ranges::data(rows)));
  const View all(first.layout().data, n, sizeof(Row) / sizeof(S), 1, first.components());
  return first.hasRows() ? all.byRows() : all;
}

/// The elements of a view as values of M, a range for mean() and the other estimators, which read the memory where it
/// is; elements that come out of it are copies.
template <class M>
class Strided {
  using S = typename detail::ElementNumbers<M>::Scalar;
  static constexpr std::size_t numbers = detail::ElementNumbers<M>::count;

 public:
  using value_type = M;

  Strided() = default;
  explicit Strided(const ArrayView<const S>& elements) : view_(elements) {
    eigen_assert(elements.components() == 0 || elements.components() == numbers);
  }

  std::size_t size() const { return view_.size(); }
  bool empty() const { return size() == 0; }
  M operator[](std::integral auto i) const {
    M x{};
    S* const to = detail::ElementNumbers<M>::data(x);
    for (std::size_t c = 0; c < numbers; ++c) to[c] = view_(static_cast<std::size_t>(i), c);
    return x;
  }
  const ArrayView<const S>& view() const { return view_; }
  const detail::Layout<const S>& layout() const { return view_.layout(); }

  /// Random access; dereferencing makes a copy.
  class Iterator {
   public:
    using value_type = M;
    using difference_type = std::ptrdiff_t;
    using reference = M;
    using pointer = void;
    using iterator_category = std::input_iterator_tag;
    using iterator_concept = std::random_access_iterator_tag;

    Iterator() = default;
    Iterator(const ArrayView<const S>& view, difference_type i) : strided_(view), i_(i) {}
    M operator*() const { return strided_[i_]; }
    M operator[](difference_type n) const { return strided_[i_ + n]; }
    Iterator& operator+=(difference_type n) {
      i_ += n;
      return *this;
    }
    Iterator& operator-=(difference_type n) { return *this += -n; }
    Iterator& operator++() { return *this += 1; }
    Iterator& operator--() { return *this += -1; }
    Iterator operator++(int) {
      const Iterator before = *this;
      ++*this;
      return before;
    }
    Iterator operator--(int) {
      const Iterator before = *this;
      --*this;
      return before;
    }
    friend Iterator operator+(Iterator a, difference_type n) { return a += n; }
    friend Iterator operator+(difference_type n, Iterator a) { return a += n; }
    friend Iterator operator-(Iterator a, difference_type n) { return a -= n; }
    friend difference_type operator-(const Iterator& a, const Iterator& b) { return a.i_ - b.i_; }
    friend bool operator==(const Iterator& a, const Iterator& b) { return a.i_ == b.i_; }
    friend auto operator<=>(const Iterator& a, const Iterator& b) { return a.i_ <=> b.i_; }

   private:
    Strided strided_;
    difference_type i_ = 0;
  };
  Iterator begin() const { return Iterator(view_, 0); }
  Iterator end() const { return Iterator(view_, static_cast<std::ptrdiff_t>(size())); }

 private:
  ArrayView<const S> view_;
};

}  // namespace liestat
