// A 64-bit key of what a measurement is: the same for equal values, whatever memory, padding bytes or order they come in.
// The draws of a hierarchy belong to these keys (stats/hierarchy.hpp).
//
// Points of manifolds, numbers, Eigen matrices, and std::variant, std::tuple and std::pair of them have one. A type of your
// own brings a function of this name with it:
//
//   struct Range {
//     Eigen::Vector2d beacon;
//     double metres, sigma;
//     friend std::uint64_t contentKey(const Range& r) {
//       return liestat::contentKey(std::tie(r.beacon, r.metres, r.sigma));
//     }
//   };
#pragma once

#include <lie/manifold.hpp>
#include <lie/rn.hpp>

#include <Eigen/Core>

#include <bit>
#include <cstddef>
#include <cstdint>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>

namespace liestat {

namespace detail {

/// A bijection of 64 bits whose values look random (the finaliser of D. Stafford's "Mix13").
constexpr std::uint64_t mixBits(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}
constexpr std::uint64_t mixBits(std::uint64_t a, std::uint64_t b) {
  return mixBits(mixBits(a + 0x9e3779b97f4a7c15u) ^ b);
}

/// Zeros of both signs are the same.
inline std::uint64_t numberKey(double x) { return std::bit_cast<std::uint64_t>(x + 0.0); }

}  // namespace detail

// They call each other.
template <class... T>
std::uint64_t contentKey(const std::variant<T...>& one);
template <class... T>
std::uint64_t contentKey(const std::tuple<T...>& several);
template <class A, class B>
std::uint64_t contentKey(const std::pair<A, B>& two);

/// The key of a number; that of a floating-point number is the one of its value in double.
template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>)
std::uint64_t contentKey(T number) {
  if constexpr (std::is_floating_point_v<T>) {
    return detail::mixBits(0, detail::numberKey(static_cast<double>(number)));
  } else {
    return detail::mixBits(0, static_cast<std::uint64_t>(number));
  }
}

/// The key of the coordinates of a point.
template <Homogeneous M>
std::uint64_t contentKey(const M& point) {
  const auto x = log(ManifoldTraits<M>::origin(), point);
  std::uint64_t key = 0;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    key = detail::mixBits(key, detail::numberKey(static_cast<double>(x[i])));
  }
  return key;
}

/// The key of the size and the coefficients of a matrix, a covariance for instance.
template <class Derived>
std::uint64_t contentKey(const Eigen::MatrixBase<Derived>& matrix) {
  std::uint64_t key = static_cast<std::uint64_t>(matrix.rows());
  for (Eigen::Index j = 0; j < matrix.cols(); ++j) {
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      key = detail::mixBits(key, detail::numberKey(static_cast<double>(matrix(i, j))));
    }
  }
  return key;
}

/// The key of an alternative and of which one it is: equal values on two channels differ.
template <class... T>
std::uint64_t contentKey(const std::variant<T...>& one) {
  const auto alternative = static_cast<std::uint64_t>(one.index());
  if (one.valueless_by_exception()) return detail::mixBits(alternative);
  return std::visit([&](const auto& value) { return detail::mixBits(alternative + 1, contentKey(value)); }, one);
}

/// The key of several values in their order.
template <class... T>
std::uint64_t contentKey(const std::tuple<T...>& several) {
  std::uint64_t key = sizeof...(T);
  std::apply([&](const auto&... value) { ((key = detail::mixBits(key, contentKey(value))), ...); }, several);
  return key;
}
template <class A, class B>
std::uint64_t contentKey(const std::pair<A, B>& two) {
  return contentKey(std::tie(two.first, two.second));
}

}  // namespace liestat
