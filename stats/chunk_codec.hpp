// Results of chunks as bytes and back, for executors whose chunks are evaluated in other processes, or at other times. Needs
// no such executor's package.
#pragma once

#include <Eigen/Core>

#include <concepts>
#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>
#include <vector>

namespace liestat {

/// A chunk result that travels as a list of doubles: `t.pack()` gives the list and `T::unpack(list)` the same T, bit
/// for bit. For types that are not trivially copyable (anything that holds a vector or an Eigen matrix).
template <class T>
concept Packable = requires(const T& t, std::span<const double> values) {
  { t.pack() } -> std::convertible_to<std::vector<double>>;
  { T::unpack(values) } -> std::convertible_to<T>;
};

namespace detail {

template <class T>
concept FixedSizeEigen = std::derived_from<T, Eigen::PlainObjectBase<T>> && T::SizeAtCompileTime != Eigen::Dynamic;

}  // namespace detail

using ChunkBytes = std::vector<std::byte>;

/// T as bytes and back, for the types that MpiExecutor can send: trivially copyable ones, vectors of them, Eigen's of fixed
/// size, and Packable ones. Machines of one run share one byte order. decode() takes what encode() gave.
template <class T>
struct ChunkCodec;

template <class U>
  requires std::is_trivially_copyable_v<U>
struct ChunkCodec<std::vector<U>> {
  static constexpr bool supported = true;

  static ChunkBytes encode(const std::vector<U>& values) {
    ChunkBytes bytes(sizeof(U) * values.size());
    if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
    return bytes;
  }
  static std::vector<U> decode(std::span<const std::byte> bytes) {
    std::vector<U> values(bytes.size() / sizeof(U));
    if (!bytes.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
    return values;
  }
};

template <class T>
struct ChunkCodec {
  static constexpr bool supported = Packable<T> || detail::FixedSizeEigen<T> || std::is_trivially_copyable_v<T>;

  static ChunkBytes encode(const T& value) {
    if constexpr (Packable<T>) {
      return ChunkCodec<std::vector<double>>::encode(value.pack());
    } else if constexpr (detail::FixedSizeEigen<T>) {
      ChunkBytes bytes(sizeof(typename T::Scalar) * T::SizeAtCompileTime);
      std::memcpy(bytes.data(), value.data(), bytes.size());
      return bytes;
    } else {
      ChunkBytes bytes(sizeof(T));
      std::memcpy(bytes.data(), &value, bytes.size());
      return bytes;
    }
  }

  static T decode(std::span<const std::byte> bytes) {
    if constexpr (Packable<T>) {
      return T::unpack(ChunkCodec<std::vector<double>>::decode(bytes));
    } else if constexpr (detail::FixedSizeEigen<T>) {
      T value;
      std::memcpy(value.data(), bytes.data(), bytes.size());
      return value;
    } else {
      T value{};
      std::memcpy(&value, bytes.data(), bytes.size());
      return value;
    }
  }
};

}  // namespace liestat
