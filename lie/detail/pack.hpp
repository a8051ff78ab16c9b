// As many numbers as a register of an instruction set holds, with the vectors of g++ and clang, which need no header
// and no flag; one number elsewhere. The set is a parameter of the type, so units compiled with different flags agree
// on what a Pack is. Everything here is inlined by force: only then it is compiled for the instructions of the kernel
// that uses it (lie/detail/kernel.hpp).
#pragma once

#include <lie/detail/always_inline.hpp>
#include <lie/instruction_set.hpp>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

// g++ contracts products and sums into fused operations by itself, clang within one expression only, unless told.
#if defined(__clang__)
#define LIESTAT_CONTRACT _Pragma("clang fp contract(fast)")
#else
#define LIESTAT_CONTRACT
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
  static constexpr std::size_t size = registerBytes(Set) / sizeof(S);
#else
  using Type = S;
  static constexpr std::size_t size = 1;
#endif
};

/// S is double or float.
template <InstructionSet Set, class S = double>
struct Pack {
  using Scalar = S;
  using Vector = typename PackStorage<Set, S>::Type;
  static constexpr InstructionSet set = Set;
  static constexpr std::size_t size = PackStorage<Set, S>::size;

  /// What a comparison gives.
  struct Mask {
    decltype(Vector{} < Vector{}) lanes;
  };

  Vector v;

  Pack() = default;
  LIESTAT_ALWAYS_INLINE explicit Pack(const Vector& lanes) : v(lanes) {}
  LIESTAT_ALWAYS_INLINE explicit Pack(S x) : v(Vector{} + x) {}

  LIESTAT_ALWAYS_INLINE static Pack zero() { return Pack(Vector{}); }
  LIESTAT_ALWAYS_INLINE static Pack load(const S* p) {
    Pack x;
    std::memcpy(&x.v, p, sizeof x.v);
    return x;
  }
  LIESTAT_ALWAYS_INLINE void store(S* p) const { std::memcpy(p, &v, sizeof v); }

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
  LIESTAT_ALWAYS_INLINE friend Pack absolute(const Pack& a) { return select(a < S(0), -a, a); }
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
    using Integer = std::conditional_t<sizeof(S) == 8, std::int64_t, std::int32_t>;
#if defined(__GNUC__)
    typedef Integer Integers __attribute__((vector_size(registerBytes(Set))));
    return Pack(__builtin_convertvector(__builtin_convertvector(a.v, Integers), Vector));
#else
    return Pack(static_cast<S>(static_cast<Integer>(a.v)));
#endif
  }
  LIESTAT_ALWAYS_INLINE friend S sumOf(const Pack& a) {
    S lanes[size], sum = 0;
    a.store(lanes);
    for (const S x : lanes) sum += x;
    return sum;
  }
  LIESTAT_ALWAYS_INLINE friend S largestOf(const Pack& a) {
    S lanes[size];
    a.store(lanes);
    S largest = lanes[0];
    for (const S x : lanes) largest = x > largest ? x : largest;
    return largest;
  }
};

}  // namespace liestat::detail
