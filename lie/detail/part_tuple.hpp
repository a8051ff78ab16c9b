// A tuple of points of several manifolds, or of elements of several groups: what Product and ProductGroup have in
// common. Parts keep their own types; coordinates stand one part after the other.
#pragma once

#include <lie/manifold.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <ostream>
#include <tuple>
#include <type_traits>
#include <utility>

namespace liestat::detail {

template <class P>
concept IsEigenVector = std::is_base_of_v<Eigen::MatrixBase<P>, P>;
template <class P>
concept HasParameters = requires(const P& x) {
  { P::num_parameters } -> std::convertible_to<int>;
  P::fromParams(x.params());
};

/// Dimension, scalar and first value of a part, which is a group's element or a manifold's point.
template <class P>
struct PartOf {
  using Scalar = typename ManifoldTraits<P>::Scalar;
  static constexpr int DoF = ManifoldTraits<P>::DoF;
  static P first() { return ManifoldTraits<P>::origin(); }
};
template <LieGroup P>
struct PartOf<P> {
  using Scalar = typename P::Scalar;
  static constexpr int DoF = P::DoF;
  static P first() { return P(); }
};

/// How many parameters a part has; none if it does not show them.
template <class P>
constexpr int parameterCount() {
  if constexpr (IsEigenVector<P>) {
    return P::RowsAtCompileTime;
  } else if constexpr (HasParameters<P>) {
    return P::num_parameters;
  } else {
    return 0;
  }
}
template <class P, class S>
concept CanCast = requires(const P& x) {
  x.template cast<S>();
};
template <class S, class P>
auto castPart(const P& x) {
  if constexpr (IsEigenVector<P>) {
    return x.template cast<S>().eval();
  } else {
    return x.template cast<S>();
  }
}

/// Calls f(std::integral_constant<std::size_t, I>) for I = 0 … N-1.
template <std::size_t N, class F>
constexpr void forEachIndex(F&& f) {
  [&]<std::size_t... I>(std::index_sequence<I...>) { (f(std::integral_constant<std::size_t, I>{}), ...); }
  (std::make_index_sequence<N>{});
}

/// The sum of the first k of a list of sizes.
template <int... Sizes>
constexpr int sumOfFirst(std::size_t k) {
  const int sizes[] = {Sizes..., 0};
  int sum = 0;
  for (std::size_t i = 0; i < k; ++i) sum += sizes[i];
  return sum;
}

/// A block-diagonal matrix; Rows and Columns are std::integer_sequence of the blocks' sizes, block(I) is the I-th.
template <class S, int... Rows, int... Columns, class Block>
auto blockDiagonal(std::integer_sequence<int, Rows...>, std::integer_sequence<int, Columns...>, const Block& block) {
  using Matrix = Eigen::Matrix<S, (Rows + ...), (Columns + ...)>;
  Matrix m;
  // As loops: each block and each matrix would be an expression of its own for the compiler.
  for (int j = 0; j < Matrix::ColsAtCompileTime; ++j) {
    for (int i = 0; i < Matrix::RowsAtCompileTime; ++i) m(i, j) = S(0);
  }
  forEachIndex<sizeof...(Rows)>([&](auto part) {
    constexpr int r = sumOfFirst<Rows...>(part), c = sumOfFirst<Columns...>(part);
    constexpr int rows = sumOfFirst<Rows...>(part + 1) - r, columns = sumOfFirst<Columns...>(part + 1) - c;
    const Eigen::Matrix<S, rows, columns> b = block(part);
    for (int j = 0; j < columns; ++j) {
      for (int i = 0; i < rows; ++i) m(r + i, c + j) = b(i, j);
    }
  });
  return m;
}

/// The tuple itself; Type is Product or ProductGroup.
template <template <class...> class Type, class... Parts>
class PartTuple {
  static_assert(sizeof...(Parts) > 0, "a product has at least one part");

 public:
  static constexpr std::size_t num_parts = sizeof...(Parts);
  template <std::size_t I>
  using Part = std::tuple_element_t<I, std::tuple<Parts...>>;
  using Scalar = typename PartOf<Part<0>>::Scalar;
  static_assert((std::is_same_v<Scalar, typename PartOf<Parts>::Scalar> && ...), "parts have one scalar type");
  static constexpr int DoF = (PartOf<Parts>::DoF + ...);
  /// Sum over the parts that show their parameters.
  static constexpr int num_parameters = (parameterCount<Parts>() + ...);
  using Tangent = Eigen::Matrix<Scalar, DoF, 1>;
  using Square = Eigen::Matrix<Scalar, DoF, DoF>;
  using Params = Eigen::Matrix<Scalar, num_parameters, 1>;
  /// The parts' dimensions.
  using Sizes = std::integer_sequence<int, PartOf<Parts>::DoF...>;

  /// The identities or origins of the parts.
  PartTuple() : parts_(PartOf<Parts>::first()...) {}
  explicit(sizeof...(Parts) == 1) PartTuple(const Parts&... parts) : parts_(parts...) {}
  explicit PartTuple(const std::tuple<Parts...>& parts) : parts_(parts) {}

  /// The I-th part.
  template <std::size_t I>
  const Part<I>& get() const {
    return std::get<I>(parts_);
  }
  template <std::size_t I>
  Part<I>& get() {
    return std::get<I>(parts_);
  }
  const std::tuple<Parts...>& parts() const { return parts_; }

  /// Where the I-th part's coordinates begin in a tangent vector.
  template <std::size_t I>
  static constexpr int tangent_offset = sumOfFirst<PartOf<Parts>::DoF...>(I);
  /// The I-th part's coordinates in a tangent vector, to read or to write.
  template <std::size_t I, class V>
  static auto tangentBlock(V& v) {
    return v.template segment<PartOf<Part<I>>::DoF>(tangent_offset<I>);
  }
  /// The covariance of the I-th part's coordinates with the J-th part's, to read or to write.
  template <std::size_t I, std::size_t J, class Matrix>
  static auto covarianceBlock(Matrix& sigma) {
    return sigma.template block<PartOf<Part<I>>::DoF, PartOf<Part<J>>::DoF>(tangent_offset<I>, tangent_offset<J>);
  }

  /// The parameters of the parts, one after the other: a copy, for they do not lie side by side in memory.
  Params params() const requires((parameterCount<Parts>() > 0) && ...) {
    Params p;
    forEachIndex<num_parts>([&](auto i) {
      constexpr int first = parameter_offset<i>, n = parameterCount<Part<i>>();
      if constexpr (IsEigenVector<Part<i>>) {
        p.template segment<n>(first) = get<i>();
      } else {
        p.template segment<n>(first) = get<i>().params();
      }
    });
    return p;
  }
  /// Takes the parameters as they are; the caller vouches for the parts' constraints.
  static Type<Parts...> fromParams(const Params& p) requires((parameterCount<Parts>() > 0) && ...) {
    Type<Parts...> x;
    forEachIndex<num_parts>([&](auto i) {
      constexpr int first = parameter_offset<i>, n = parameterCount<Part<i>>();
      if constexpr (IsEigenVector<Part<i>>) {
        x.template get<i>() = p.template segment<n>(first);
      } else {
        x.template get<i>() = Part<i>::fromParams(p.template segment<n>(first));
      }
    });
    return x;
  }
  /// The same value in another scalar type.
  template <class NewScalar>
  auto cast() const requires(CanCast<Parts, NewScalar>&&...) {
    return std::apply(
        [](const Parts&... x) {
          return Type<std::decay_t<decltype(castPart<NewScalar>(x))>...>(castPart<NewScalar>(x)...);
        },
        parts_);
  }

 private:
  template <std::size_t I>
  static constexpr int parameter_offset = sumOfFirst<parameterCount<Parts>()...>(I);

  std::tuple<Parts...> parts_;
};

template <template <class...> class Type, class... Parts>
std::ostream& operator<<(std::ostream& os, const PartTuple<Type, Parts...>& x) requires requires {
  x.params();
}
{ return os << x.params().transpose(); }

}  // namespace liestat::detail
