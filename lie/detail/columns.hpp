// Arrays of elements in memory, and their way to columns and back, a block at a time, inside kernels.
#pragma once

#include <lie/detail/always_inline.hpp>
#include <lie/instruction_set.hpp>

#include <cstddef>
#include <cstring>

namespace liestat::detail {

/// Number c of element i is data[i element + c component]: component is 1 in an array of elements, element is 1 in a
/// structure of arrays. T is S to write to, const S to read.
template <class T>
struct Layout {
  T* data = nullptr;
  std::ptrdiff_t element = 0, component = 1;

  LIESTAT_ALWAYS_INLINE T* at(std::size_t i, std::size_t c) const {
    return data + static_cast<std::ptrdiff_t>(i) * element + static_cast<std::ptrdiff_t>(c) * component;
  }
};

#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define LIESTAT_HAS_SHUFFLES 1
#endif
#endif
#ifndef LIESTAT_HAS_SHUFFLES
#define LIESTAT_HAS_SHUFFLES 0
#endif

#if LIESTAT_HAS_SHUFFLES
template <class S>
struct FourNumbers {
  typedef S Vector __attribute__((vector_size(4 * sizeof(S))));
  Vector v;
};
/// Transposes four rows of four numbers.
template <class S>
LIESTAT_ALWAYS_INLINE void transpose(FourNumbers<S> (&r)[4]) {
  using V = typename FourNumbers<S>::Vector;
  const V a = __builtin_shufflevector(r[0].v, r[1].v, 0, 4, 2, 6),
          b = __builtin_shufflevector(r[0].v, r[1].v, 1, 5, 3, 7),
          c = __builtin_shufflevector(r[2].v, r[3].v, 0, 4, 2, 6),
          d = __builtin_shufflevector(r[2].v, r[3].v, 1, 5, 3, 7);
  r[0].v = __builtin_shufflevector(a, c, 0, 1, 4, 5);
  r[1].v = __builtin_shufflevector(b, d, 0, 1, 4, 5);
  r[2].v = __builtin_shufflevector(a, c, 2, 3, 6, 7);
  r[3].v = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}
/// Components first … first + 3 of the elements i … i + 3, one behind the other in each, to four numbers of four columns.
template <class S, std::size_t B>
LIESTAT_ALWAYS_INLINE void loadFour(const Layout<const S>& from, std::size_t first, std::size_t i, S (*columns)[B],
                                    std::size_t j) {
  FourNumbers<S> rows[4];
  LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) std::memcpy(&rows[k].v, from.at(i + k, first), sizeof rows[k].v);
  transpose(rows);
  LIESTAT_UNROLL for (std::size_t c = 0; c < 4; ++c) std::memcpy(columns[c] + j, &rows[c].v, sizeof rows[c].v);
}
template <class S, std::size_t B>
LIESTAT_ALWAYS_INLINE void storeFour(const S (*columns)[B], std::size_t j, const Layout<S>& to, std::size_t first,
                                     std::size_t i) {
  FourNumbers<S> rows[4];
  LIESTAT_UNROLL for (std::size_t c = 0; c < 4; ++c) std::memcpy(&rows[c].v, columns[c] + j, sizeof rows[c].v);
  transpose(rows);
  LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) std::memcpy(to.at(i + k, first), &rows[k].v, sizeof rows[k].v);
}
/// Twelve numbers x0 y0 z0 x1 … z3 to x0 … x3, y0 … y3, z0 … z3, and back: each column has one number in every place of
/// the three rows.
template <class S>
LIESTAT_ALWAYS_INLINE void separateTriples(FourNumbers<S> (&r)[3]) {
  using V = typename FourNumbers<S>::Vector;
  const V a = r[0].v, b = r[1].v, c = r[2].v;
  const V x = __builtin_shufflevector(__builtin_shufflevector(a, b, 0, 1, 6, 3), c, 0, 5, 2, 3),
          y = __builtin_shufflevector(__builtin_shufflevector(b, a, 0, 5, 2, 3), c, 0, 1, 6, 3),
          z = __builtin_shufflevector(__builtin_shufflevector(c, b, 0, 5, 2, 3), a, 0, 1, 6, 3);
  r[0].v = __builtin_shufflevector(x, x, 0, 3, 2, 1);
  r[1].v = __builtin_shufflevector(y, y, 1, 0, 3, 2);
  r[2].v = __builtin_shufflevector(z, z, 2, 1, 0, 3);
}
template <class S>
LIESTAT_ALWAYS_INLINE void joinTriples(FourNumbers<S> (&r)[3]) {
  using V = typename FourNumbers<S>::Vector;
  const V x = __builtin_shufflevector(r[0].v, r[0].v, 0, 3, 2, 1),
          y = __builtin_shufflevector(r[1].v, r[1].v, 1, 0, 3, 2),
          z = __builtin_shufflevector(r[2].v, r[2].v, 2, 1, 0, 3);
  r[0].v = __builtin_shufflevector(__builtin_shufflevector(x, y, 0, 5, 2, 3), z, 0, 1, 6, 3);
  r[1].v = __builtin_shufflevector(__builtin_shufflevector(y, z, 0, 5, 2, 3), x, 0, 1, 6, 3);
  r[2].v = __builtin_shufflevector(__builtin_shufflevector(z, x, 0, 5, 2, 3), y, 0, 1, 6, 3);
}
/// Eight numbers x0 y0 … y3 to x0 … x3, y0 … y3, and back.
template <class S>
LIESTAT_ALWAYS_INLINE void separatePairs(FourNumbers<S> (&r)[2]) {
  const typename FourNumbers<S>::Vector a = r[0].v, b = r[1].v;
  r[0].v = __builtin_shufflevector(a, b, 0, 2, 4, 6);
  r[1].v = __builtin_shufflevector(a, b, 1, 3, 5, 7);
}
template <class S>
LIESTAT_ALWAYS_INLINE void joinPairs(FourNumbers<S> (&r)[2]) {
  const typename FourNumbers<S>::Vector x = r[0].v, y = r[1].v;
  r[0].v = __builtin_shufflevector(x, y, 0, 4, 1, 5);
  r[1].v = __builtin_shufflevector(x, y, 2, 6, 3, 7);
}

/// As many of the elements as go four at a time; how many that is. Where the number of components is not a multiple of
/// four, the last four overlap those before.
template <std::size_t N, class S, std::size_t B>
LIESTAT_ALWAYS_INLINE std::size_t loadByFours(const Layout<const S>& from, std::size_t first, std::size_t begin,
                                              std::size_t count, S (*columns)[B]) {
  std::size_t j = 0;
  if constexpr (N >= 4) {
    for (; j + 4 <= count; j += 4) {
      for (std::size_t c = 0; c + 4 <= N; c += 4) loadFour(from, first + c, begin + j, columns + c, j);
      if constexpr (N % 4 != 0) loadFour(from, first + N - 4, begin + j, columns + N - 4, j);
    }
  } else if constexpr (N > 1) {
    if (from.element != N) return 0;
    for (; j + 4 <= count; j += 4) {
      FourNumbers<S> rows[N];
      std::memcpy(rows, from.at(begin + j, first), sizeof rows);
      if constexpr (N == 3) {
        separateTriples(rows);
      } else {
        separatePairs(rows);
      }
      LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) std::memcpy(columns[c] + j, &rows[c].v, sizeof rows[c].v);
    }
  }
  return j;
}
template <std::size_t N, class S, std::size_t B>
LIESTAT_ALWAYS_INLINE std::size_t storeByFours(const S (*columns)[B], const Layout<S>& to, std::size_t first,
                                               std::size_t begin, std::size_t count) {
  std::size_t j = 0;
  if constexpr (N >= 4) {
    for (; j + 4 <= count; j += 4) {
      for (std::size_t c = 0; c + 4 <= N; c += 4) storeFour(columns + c, j, to, first + c, begin + j);
      if constexpr (N % 4 != 0) storeFour(columns + N - 4, j, to, first + N - 4, begin + j);
    }
  } else if constexpr (N > 1) {
    if (to.element != N) return 0;
    for (; j + 4 <= count; j += 4) {
      FourNumbers<S> rows[N];
      LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) std::memcpy(&rows[c].v, columns[c] + j, sizeof rows[c].v);
      if constexpr (N == 3) {
        joinTriples(rows);
      } else {
        joinPairs(rows);
      }
      std::memcpy(to.at(begin + j, first), rows, sizeof rows);
    }
  }
  return j;
}
#endif

/// Components first … first + N - 1 of the elements begin … begin + count - 1 into N columns of B numbers.
template <InstructionSet Set, std::size_t N, class S, std::size_t B>
LIESTAT_ALWAYS_INLINE void loadColumns(const Layout<const S>& from, std::size_t first, std::size_t begin,
                                       std::size_t count, S (*columns)[B]) {
  if (from.element == 1) {
    for (std::size_t c = 0; c < N; ++c) std::memcpy(columns[c], from.at(begin, first + c), count * sizeof(S));
    return;
  }
  std::size_t j = 0;
#if LIESTAT_HAS_SHUFFLES
  if constexpr (Set != InstructionSet::baseline) {
    if (from.component == 1) j = loadByFours<N>(from, first, begin, count, columns);
  }
#endif
  for (; j < count; ++j) {
    for (std::size_t c = 0; c < N; ++c) columns[c][j] = *from.at(begin + j, first + c);
  }
}

/// The way back.
template <InstructionSet Set, std::size_t N, class S, std::size_t B>
LIESTAT_ALWAYS_INLINE void storeColumns(const S (*columns)[B], const Layout<S>& to, std::size_t first,
                                        std::size_t begin, std::size_t count) {
  if (to.element == 1) {
    for (std::size_t c = 0; c < N; ++c) std::memcpy(to.at(begin, first + c), columns[c], count * sizeof(S));
    return;
  }
  std::size_t j = 0;
#if LIESTAT_HAS_SHUFFLES
  if constexpr (Set != InstructionSet::baseline) {
    if (to.component == 1) j = storeByFours<N>(columns, to, first, begin, count);
  }
#endif
  for (; j < count; ++j) {
    for (std::size_t c = 0; c < N; ++c) *to.at(begin + j, first + c) = columns[c][j];
  }
}

}  // namespace liestat::detail
