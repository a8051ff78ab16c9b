// Four numbers of a scalar formula at a time, in the vector registers of the unit's own flags: one of four doubles where
// there are such, else two of two. Written with the vectors of g++ and clang, which need no header. Everything here is
// inlined, so that no symbol depends on the flags.
#pragma once

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstring>
#include <limits>
#include <type_traits>

namespace liestat::detail {

#if defined(__GNUC__)
/// Scalars whose polynomials are evaluated in lanes.
template <class S>
inline constexpr bool has_lanes = std::is_same_v<S, double> || std::is_same_v<S, float>;

typedef float FloatLanes __attribute__((vector_size(16)));
typedef double DoublePair __attribute__((vector_size(16)));
typedef double DoubleLanes __attribute__((vector_size(32)));

/// Σ c_k x^k over the first `terms` coefficients: the coefficients of four successive powers fill a vector, whose powers
/// go up by x⁴.
template <std::size_t terms, class S, std::size_t N>
EIGEN_ALWAYS_INLINE S polynomialInLanes(const std::array<double, N>& c, const S& x) {
  constexpr std::size_t groups = (terms + 3) / 4;
  const auto at = [&c](std::size_t k) { return k < terms ? static_cast<S>(c[k]) : S(0); };
  const S x2 = x * x, x4 = x2 * x2;
  if constexpr (std::is_same_v<S, float>) {
    FloatLanes sum = {at(4 * groups - 4), at(4 * groups - 3), at(4 * groups - 2), at(4 * groups - 1)};
#pragma GCC unroll 8
    for (std::size_t g = groups - 1; g > 0; --g) {
      sum = sum * x4 + FloatLanes{at(4 * g - 4), at(4 * g - 3), at(4 * g - 2), at(4 * g - 1)};
    }
    return (sum[0] + sum[1] * x) + (sum[2] + sum[3] * x) * x2;
  } else {
#if defined(__AVX__)
    DoubleLanes sum = {at(4 * groups - 4), at(4 * groups - 3), at(4 * groups - 2), at(4 * groups - 1)};
#pragma GCC unroll 8
    for (std::size_t g = groups - 1; g > 0; --g) {
      sum = sum * x4 + DoubleLanes{at(4 * g - 4), at(4 * g - 3), at(4 * g - 2), at(4 * g - 1)};
    }
    const DoublePair low = {sum[0], sum[1]}, high = {sum[2], sum[3]};
#else
    DoublePair low = {at(4 * groups - 4), at(4 * groups - 3)}, high = {at(4 * groups - 2), at(4 * groups - 1)};
#pragma GCC unroll 8
    for (std::size_t g = groups - 1; g > 0; --g) {
      low = low * x4 + DoublePair{at(4 * g - 4), at(4 * g - 3)};
      high = high * x4 + DoublePair{at(4 * g - 2), at(4 * g - 1)};
    }
#endif
    const DoublePair sum_of_halves = low + high * x2;
    return sum_of_halves[0] + sum_of_halves[1] * x;
  }
}

/// Four numbers to memory as registers hold them, for readers that take them back so.
EIGEN_ALWAYS_INLINE void storeInLanes(double a, double b, double c, double d, double* to) {
#if defined(__AVX__)
  const DoubleLanes all = {a, b, c, d};
  std::memcpy(to, &all, sizeof all);
#else
  const DoublePair low = {a, b}, high = {c, d};
  std::memcpy(to, &low, sizeof low), std::memcpy(to + 2, &high, sizeof high);
#endif
}

#if defined(__AVX__)
/// The product of quaternions x y z w: the second one's coordinates in the order and with the signs that each coordinate
/// of the first one multiplies.
EIGEN_ALWAYS_INLINE void quaternionProductInLanes(const double* a, const double* b, double* product) {
  DoubleLanes q;
  std::memcpy(&q, b, sizeof q);
  const DoubleLanes x = __builtin_shufflevector(q, q, 3, 2, 1, 0), y = __builtin_shufflevector(q, q, 2, 3, 0, 1),
                    z = __builtin_shufflevector(q, q, 1, 0, 3, 2);
  // Signs are bits of the shuffled factor, so that the other one's coordinates go to all lanes as they are loaded.
  typedef long long Signs __attribute__((vector_size(32)));
  constexpr long long minus = std::numeric_limits<long long>::min();
  const auto with = [](const DoubleLanes& lanes, const Signs& signs) {
    return reinterpret_cast<DoubleLanes>(reinterpret_cast<Signs>(lanes) ^ signs);
  };
  const DoubleLanes r = (q * a[3] + with(x, Signs{0, minus, 0, minus}) * a[0]) +
                        (with(y, Signs{0, 0, minus, minus}) * a[1] + with(z, Signs{minus, 0, 0, minus}) * a[2]);
  std::memcpy(product, &r, sizeof r);
}
#endif
#else
template <class S>
inline constexpr bool has_lanes = false;
#endif

}  // namespace liestat::detail
