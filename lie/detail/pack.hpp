// As many numbers as a register of an instruction set holds, with the vectors of g++ and clang, which need no header
// and no flag; one number elsewhere. The set is a parameter of the type, so units compiled with different flags agree
// on what a Pack is. Everything here is inlined by force: only then it is compiled for the instructions of the kernel
// that uses it (lie/detail/kernel.hpp).
#pragma once

#include <lie/detail/always_inline.hpp>
#include <lie/instruction_set.hpp>

#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>
#include <utility>

// g++ contracts products and sums into fused operations by itself, clang within one expression only, unless told.
#if defined(__clang__)
#define LIESTAT_CONTRACT _Pragma("clang fp contract(fast)")
#else
#define LIESTAT_CONTRACT
#endif

#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define LIESTAT_HAS_SHUFFLES 1
#endif
#endif
#ifndef LIESTAT_HAS_SHUFFLES
#define LIESTAT_HAS_SHUFFLES 0
#endif

namespace liestat::detail {

constexpr std::size_t registerBytes(InstructionSet set) {
#if defined(__GNUC__)
  return set == InstructionSet::avx512 ? 64 : set == InstructionSet::avx2 ? 32 : 16;
#else
  return 0 * static_cast<std::size_t>(set);
#endif
}

template <InstructionSet Set, class S>
struct PackStorage {
#if defined(__GNUC__)
  typedef S Type __attribute__((vector_size(registerBytes(Set))));
  /// The same anywhere in memory. g++ 12 copies by memcpy in halves, through the stack, in kernels for larger registers
  /// than those of their unit.
  struct __attribute__((packed, may_alias)) Memory {
    Type v;
  };
  using Integer = std::conditional_t<sizeof(S) == 8, std::int64_t, std::int32_t>;
  typedef Integer Integers __attribute__((vector_size(registerBytes(Set))));
  static constexpr std::size_t size = registerBytes(Set) / sizeof(S);
#else
  using Type = S;
  struct Memory {
    Type v;
  };
  using Integer = long long;
  using Integers = long long;
  static constexpr std::size_t size = 1;
#endif
};

template <class S>
concept PackScalar = std::same_as<S, double> || std::same_as<S, float>;

template <InstructionSet Set, PackScalar S = double>
struct Pack {
  using Scalar = S;
  using Vector = typename PackStorage<Set, S>::Type;
  using Memory = typename PackStorage<Set, S>::Memory;
  using Integer = typename PackStorage<Set, S>::Integer;
  using Integers = typename PackStorage<Set, S>::Integers;
  static constexpr InstructionSet set = Set;
  static constexpr std::size_t size = PackStorage<Set, S>::size;

  /// The result of a comparison.
  struct Mask {
    decltype(Vector{} < Vector{}) lanes;
  };

  Vector v;

  Pack() = default;
  LIESTAT_ALWAYS_INLINE explicit Pack(const Vector& lanes) : v(lanes) {}
  /// For constants: g++ 12 makes one vector of this sum, but no other expression of them. It turns -0 into 0.
  LIESTAT_ALWAYS_INLINE explicit Pack(S x) : v(Vector{} + x) {}

  LIESTAT_ALWAYS_INLINE static Pack zero() { return Pack(Vector{}); }
  LIESTAT_ALWAYS_INLINE static Pack load(const S* p) {
    Pack x;  // no constructor: a reference to the vector in memory would promise its alignment
    x.v = reinterpret_cast<const Memory*>(p)->v;
    return x;
  }
  LIESTAT_ALWAYS_INLINE void store(S* p) const { reinterpret_cast<Memory*>(p)->v = v; }

  LIESTAT_ALWAYS_INLINE Pack operator-() const { return Pack(-v); }
  LIESTAT_ALWAYS_INLINE friend Pack operator+(const Pack& a, const Pack& b) {
    LIESTAT_CONTRACT
    return Pack(a.v + b.v);
  }
  LIESTAT_ALWAYS_INLINE friend Pack operator-(const Pack& a, const Pack& b) {
    LIESTAT_CONTRACT
    return Pack(a.v - b.v);
  }
  LIESTAT_ALWAYS_INLINE friend Pack operator*(const Pack& a, const Pack& b) {
    LIESTAT_CONTRACT
    return Pack(a.v * b.v);
  }
  LIESTAT_ALWAYS_INLINE friend Pack operator/(const Pack& a, const Pack& b) { return Pack(a.v / b.v); }
  LIESTAT_ALWAYS_INLINE friend Pack operator+(const Pack& a, S b) { return a + Pack(b); }
  LIESTAT_ALWAYS_INLINE friend Pack operator+(S a, const Pack& b) { return Pack(a) + b; }
  LIESTAT_ALWAYS_INLINE friend Pack operator-(const Pack& a, S b) { return a - Pack(b); }
  LIESTAT_ALWAYS_INLINE friend Pack operator-(S a, const Pack& b) { return Pack(a) - b; }
  LIESTAT_ALWAYS_INLINE friend Pack operator*(const Pack& a, S b) { return a * Pack(b); }
  LIESTAT_ALWAYS_INLINE friend Pack operator*(S a, const Pack& b) { return Pack(a) * b; }
  LIESTAT_ALWAYS_INLINE friend Pack operator/(S a, const Pack& b) { return Pack(a) / b; }
  LIESTAT_ALWAYS_INLINE Pack& operator+=(const Pack& a) { return *this = *this + a; }
  LIESTAT_ALWAYS_INLINE Pack& operator-=(const Pack& a) { return *this = *this - a; }
  LIESTAT_ALWAYS_INLINE Pack& operator*=(const Pack& a) { return *this = *this * a; }

  LIESTAT_ALWAYS_INLINE friend Mask operator<(const Pack& a, const Pack& b) { return {a.v < b.v}; }
  LIESTAT_ALWAYS_INLINE friend Mask operator>(const Pack& a, const Pack& b) { return {a.v > b.v}; }
  LIESTAT_ALWAYS_INLINE friend Mask operator<(const Pack& a, S b) { return a < Pack(b); }
  LIESTAT_ALWAYS_INLINE friend Mask operator>(const Pack& a, S b) { return a > Pack(b); }

  /// a where the mask holds, else b.
  LIESTAT_ALWAYS_INLINE friend Pack select(const Mask& mask, const Pack& a, const Pack& b) {
    return Pack(mask.lanes ? a.v : b.v);
  }
  /// True if the mask holds in any lane.
  LIESTAT_ALWAYS_INLINE friend bool anyOf(const Mask& mask) {
#if LIESTAT_HAS_SHUFFLES
    using Words = typename PackStorage<Set, std::int64_t>::Type;
    const Words words = reinterpret_cast<Words>(mask.lanes);
    if constexpr (registerBytes(Set) == 64) {
      const auto half =
          __builtin_shufflevector(words, words, 0, 1, 2, 3) | __builtin_shufflevector(words, words, 4, 5, 6, 7);
      const auto quarter = __builtin_shufflevector(half, half, 0, 1) | __builtin_shufflevector(half, half, 2, 3);
      return (quarter[0] | quarter[1]) != 0;
    } else if constexpr (registerBytes(Set) == 32) {
      const auto half = __builtin_shufflevector(words, words, 0, 1) | __builtin_shufflevector(words, words, 2, 3);
      return (half[0] | half[1]) != 0;
    } else {
      return (words[0] | words[1]) != 0;
    }
#elif defined(__GNUC__)
    auto any = mask.lanes[0];
    for (std::size_t l = 1; l < size; ++l) any |= mask.lanes[l];
    return any != 0;
#else
    return mask.lanes;
#endif
  }
  LIESTAT_ALWAYS_INLINE friend Pack absolute(const Pack& a) {
#if defined(__GNUC__)
    const Integers bits = reinterpret_cast<Integers>(a.v) & std::numeric_limits<Integer>::max();
    return Pack(reinterpret_cast<Vector>(bits));
#else
    return select(a < S(0), -a, a);
#endif
  }
  LIESTAT_ALWAYS_INLINE friend Pack larger(const Pack& a, const Pack& b) { return select(a > b, a, b); }
  LIESTAT_ALWAYS_INLINE friend Pack smaller(const Pack& a, const Pack& b) { return select(a < b, a, b); }
  /// 1/√a of normal numbers a > 0, to two units in the last place: a first guess from the exponent's bits, and Newton's
  /// method. Of zero a large number, so that a times it is the root there, too.
  LIESTAT_ALWAYS_INLINE friend Pack inverseSquareRoot(const Pack& a) {
    using Bits = std::conditional_t<sizeof(S) == 8, std::int64_t, std::int32_t>;
    constexpr Bits guess = sizeof(S) == 8 ? static_cast<Bits>(0x5fe6eb50c7b537a9) : static_cast<Bits>(0x5f3759df);
    using Lanes = decltype(Mask::lanes);
    Lanes bits;
    std::memcpy(&bits, &a.v, sizeof bits);
    bits = guess - (bits >> 1);
    Pack y;
    std::memcpy(&y.v, &bits, sizeof bits);
    const Pack half = S(0.5) * a;
    for (int i = 0; i < (sizeof(S) == 8 ? 4 : 3); ++i) y = y + y * (S(0.5) - half * y * y);
    return y;
  }
  /// The integer next to a towards zero; |a| < 2⁵² (float: 2²³).
  LIESTAT_ALWAYS_INLINE friend Pack truncated(const Pack& a) {
#if defined(__GNUC__)
    return Pack(__builtin_convertvector(__builtin_convertvector(a.v, Integers), Vector));
#else
    return Pack(static_cast<S>(static_cast<long long>(a.v)));
#endif
  }
  /// Halves are added to each other in registers, down to two numbers.
  LIESTAT_ALWAYS_INLINE friend S sumOf(const Pack& a) {
#if LIESTAT_HAS_SHUFFLES
    if constexpr (registerBytes(Set) > 16) {
      Half low, high;
      a.split(low, high, std::make_index_sequence<size / 2>());
      return sumOf(low + high);
    } else if constexpr (size == 4) {
      return (a.v[0] + a.v[2]) + (a.v[1] + a.v[3]);
    } else {
      return a.v[0] + a.v[1];
    }
#else
    S lanes[size], sum = 0;
    a.store(lanes);
    for (const S x : lanes) sum += x;
    return sum;
#endif
  }
  LIESTAT_ALWAYS_INLINE friend S largestOf(const Pack& a) {
#if LIESTAT_HAS_SHUFFLES
    if constexpr (registerBytes(Set) > 16) {
      Half low, high;
      a.split(low, high, std::make_index_sequence<size / 2>());
      return largestOf(larger(high, low));
    }
#endif
    S lanes[size];
    a.store(lanes);
    S largest = lanes[0];
    for (const S x : lanes) largest = x > largest ? x : largest;
    return largest;
  }

#if LIESTAT_HAS_SHUFFLES
 private:
  using Half = Pack<Set == InstructionSet::avx512 ? InstructionSet::avx2 : InstructionSet::baseline, S>;

  template <std::size_t... Lane>
  LIESTAT_ALWAYS_INLINE void split(Half& low, Half& high, std::index_sequence<Lane...>) const {
    low.v = __builtin_shufflevector(v, v, static_cast<int>(Lane)...);
    high.v = __builtin_shufflevector(v, v, static_cast<int>(Lane + size / 2)...);
  }
#endif
};

}  // namespace liestat::detail
