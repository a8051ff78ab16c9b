// Arrays of elements in memory, and their way to columns and back, a block at a time, inside kernels.
#pragma once

#include <lie/detail/always_inline.hpp>
#include <lie/detail/pack.hpp>
#include <lie/instruction_set.hpp>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

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

#if LIESTAT_HAS_SHUFFLES
template <class S>
struct FourNumbers {
  typedef S Vector __attribute__((vector_size(4 * sizeof(S))));
  /// The same anywhere in memory, as in lie/detail/pack.hpp.
  struct __attribute__((packed, may_alias)) Memory {
    Vector v;
  };
  Vector v;

  LIESTAT_ALWAYS_INLINE void load(const S* p) { v = reinterpret_cast<const Memory*>(p)->v; }
  LIESTAT_ALWAYS_INLINE void store(S* p) const { reinterpret_cast<Memory*>(p)->v = v; }
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
/// Lane l is lane Index::of(l) of a, or of b where that is P::size or more.
template <class Index, class P, std::size_t... Lane>
LIESTAT_ALWAYS_INLINE P permuted(const P& a, const P& b, std::index_sequence<Lane...>) {
  P x;
  x.v = __builtin_shufflevector(a.v, b.v, Index::of(Lane)...);
  return x;
}
template <class Index, class P>
LIESTAT_ALWAYS_INLINE P permuted(const P& a, const P& b) {
  return permuted<Index>(a, b, std::make_index_sequence<P::size>());
}
/// For `permuted`: of rows of four numbers in two registers, components Component and Component + 1, one column after the
/// other.
template <std::size_t size, std::size_t Component>
struct TwoOfFour {
  static constexpr int of(std::size_t l) {
    const std::size_t half = size / 2;
    return static_cast<int>(4 * (l % half) + Component + l / half);
  }
};
/// The way back: rows from First on of four columns, two in each register.
template <std::size_t size, std::size_t First>
struct FourOfTwo {
  static constexpr int of(std::size_t l) {
    const std::size_t half = size / 2, component = l % 4;
    return static_cast<int>(component / 2 * size + component % 2 * half + First + l / 4);
  }
};
/// The first halves of two registers, or the second.
template <std::size_t size, std::size_t Half>
struct Halves {
  static constexpr int of(std::size_t l) {
    const std::size_t half = size / 2;
    return static_cast<int>(l / half * size + Half * half + l % half);
  }
};
/// The columns of the rows of four numbers that stand in four registers one after the other, and the way back; for
/// instructions that take any two registers' numbers in any order.
template <class P>
LIESTAT_ALWAYS_INLINE void rowsToColumns(const P (&r)[4], P (&columns)[4]) {
  constexpr std::size_t size = P::size;
  const P xy = permuted<TwoOfFour<size, 0>>(r[0], r[1]), zw = permuted<TwoOfFour<size, 2>>(r[0], r[1]),
          XY = permuted<TwoOfFour<size, 0>>(r[2], r[3]), ZW = permuted<TwoOfFour<size, 2>>(r[2], r[3]);
  columns[0] = permuted<Halves<size, 0>>(xy, XY), columns[1] = permuted<Halves<size, 1>>(xy, XY);
  columns[2] = permuted<Halves<size, 0>>(zw, ZW), columns[3] = permuted<Halves<size, 1>>(zw, ZW);
}
template <class P>
LIESTAT_ALWAYS_INLINE void columnsToRows(const P& x, const P& y, const P& z, const P& w, P (&r)[4]) {
  constexpr std::size_t size = P::size, rows = size / 4;
  const P xy = permuted<Halves<size, 0>>(x, y), zw = permuted<Halves<size, 0>>(z, w),
          XY = permuted<Halves<size, 1>>(x, y), ZW = permuted<Halves<size, 1>>(z, w);
  r[0] = permuted<FourOfTwo<size, 0>>(xy, zw), r[1] = permuted<FourOfTwo<size, rows>>(xy, zw);
  r[2] = permuted<FourOfTwo<size, 0>>(XY, ZW), r[3] = permuted<FourOfTwo<size, rows>>(XY, ZW);
}
/// The columns of as many rows of four numbers as a register holds: of an array of rows, or of rows that follow one
/// another without a gap.
LIESTAT_ALWAYS_INLINE void transposeRows(const double* const (&row)[4],
                                         Pack<InstructionSet::avx2, double> (&columns)[4]) {
  FourNumbers<double> r[4];
  LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) r[k].load(row[k]);
  transpose(r);
  LIESTAT_UNROLL for (std::size_t c = 0; c < 4; ++c) columns[c].v = r[c].v;
}
LIESTAT_ALWAYS_INLINE void transposeRows(const double* rows, Pack<InstructionSet::avx2, double> (&columns)[4]) {
  const double* const row[4] = {rows, rows + 4, rows + 8, rows + 12};
  transposeRows(row, columns);
}
LIESTAT_ALWAYS_INLINE void transposeRows(const double* const (&row)[8],
                                         Pack<InstructionSet::avx512, double> (&columns)[4]) {
  Pack<InstructionSet::avx512, double> r[4];
  LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) {
    FourNumbers<double> low, high;
    low.load(row[2 * k]), high.load(row[2 * k + 1]);
    r[k].v = __builtin_shufflevector(low.v, high.v, 0, 1, 2, 3, 4, 5, 6, 7);
  }
  rowsToColumns(r, columns);
}
LIESTAT_ALWAYS_INLINE void transposeRows(const double* rows, Pack<InstructionSet::avx512, double> (&columns)[4]) {
  Pack<InstructionSet::avx512, double> r[4];
  LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) r[k] = Pack<InstructionSet::avx512, double>::load(rows + 8 * k);
  rowsToColumns(r, columns);
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
  if constexpr (N == 4 && Set != InstructionSet::baseline) {
    if (from.component == 1) {
      for (; j + 4 <= count; j += 4) {
        FourNumbers<S> rows[4];
        LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) rows[k].load(from.at(begin + j + k, first));
        transpose(rows);
        LIESTAT_UNROLL for (std::size_t c = 0; c < 4; ++c) rows[c].store(columns[c] + j);
      }
    }
  }
#endif
  for (; j < count; ++j) {
    for (std::size_t c = 0; c < N; ++c) columns[c][j] = *from.at(begin + j, first + c);
  }
}

/// True if loadRows serves registers of this kind.
template <class P>
inline constexpr bool loads_rows =
    LIESTAT_HAS_SHUFFLES&& P::set != InstructionSet::baseline&& std::is_same_v<typename P::Scalar, double>;

/// Asks for what a kernel will read a page after the number at p: the processor by itself reads ahead too little for
/// kernels that take less time than their data take from memory.
LIESTAT_ALWAYS_INLINE void prefetch(const void* p) {
  __builtin_prefetch(reinterpret_cast<const void*>(reinterpret_cast<std::uintptr_t>(p) + 4096));
}

/// Components first … first + 3 of the element `begin` and those after it, of which there are `left`, in one register each,
/// from an array of elements (component is 1); the lanes beyond the last are filled up with the numbers `fill`. Rows are
/// transposed in registers: one that is read back just after its numbers have been stored one by one would wait for them.
template <class P, class S>
LIESTAT_ALWAYS_INLINE void loadRows(const Layout<const S>& from, std::size_t first, std::size_t begin, std::size_t left,
                                    const S* fill, P (&columns)[4]) {
  if constexpr (loads_rows<P>) {
    const S *const start = from.at(begin, first), *row[P::size];
    if (left >= P::size && from.element == 4) {
      LIESTAT_UNROLL for (std::size_t k = 0; k < P::size; k += 2) prefetch(start + 4 * k);
      transposeRows(start, columns);
      return;
    }
    if (left >= P::size) {
      LIESTAT_UNROLL for (std::size_t k = 0; k < P::size; ++k) {
        row[k] = start + static_cast<std::ptrdiff_t>(k) * from.element;
        if (first == 0) prefetch(row[k]);
      }
    } else {
      LIESTAT_UNROLL for (std::size_t k = 0; k < P::size; ++k) {
        row[k] = k < left ? start + static_cast<std::ptrdiff_t>(k) * from.element : fill;
      }
    }
    transposeRows(row, columns);
  }
}

/// As loadColumns, and fills the last register of each column up with the numbers `fill`.
template <class P, std::size_t N, class S, std::size_t B>
LIESTAT_ALWAYS_INLINE void loadFilled(const Layout<const S>& from, std::size_t first, std::size_t begin,
                                      std::size_t count, const S* fill, S (*columns)[B]) {
  loadColumns<P::set, N>(from, first, begin, count, columns);
  for (std::size_t j = count; j % P::size != 0; ++j) {
    for (std::size_t c = 0; c < N; ++c) columns[c][j] = fill[c];
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
  if constexpr (N == 4 && Set != InstructionSet::baseline) {
    if (to.component == 1) {
      for (; j + 4 <= count; j += 4) {
        FourNumbers<S> rows[4];
        LIESTAT_UNROLL for (std::size_t c = 0; c < 4; ++c) rows[c].load(columns[c] + j);
        transpose(rows);
        LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) rows[k].store(to.at(begin + j + k, first));
      }
    }
  }
#endif
  for (; j < count; ++j) {
    for (std::size_t c = 0; c < N; ++c) *to.at(begin + j, first + c) = columns[c][j];
  }
}

}  // namespace liestat::detail
