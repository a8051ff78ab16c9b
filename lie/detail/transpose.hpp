// Transpositions in registers: from elements of a few numbers, one behind the other, to a register for each of these
// numbers, and back. A register that is read just after its numbers have been stored one by one would wait for them.
#pragma once

#include <lie/detail/always_inline.hpp>
#include <lie/detail/pack.hpp>
#include <lie/instruction_set.hpp>

#include <cstddef>
#include <utility>

#if LIESTAT_HAS_SHUFFLES
namespace liestat::detail {

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
/// For `permuted`: every second number of each 128 bits of two registers, in turns, of the lower halves of these bits or
/// of the upper ones; `width` numbers are 128 bits. No other permutation takes less time.
template <std::size_t size, std::size_t width, bool upper>
struct Unpacked {
  static constexpr int of(std::size_t l) {
    const std::size_t k = l % width, number = l - k + k / 2 + (upper ? width / 2 : 0);
    return static_cast<int>(k % 2 * size + number);
  }
};
/// Then, column `component` of rows of four numbers in registers 0, 1, 2, 3, of which 0 and 1, and 2 and 3, have been
/// unpacked.
template <std::size_t size, std::size_t width, std::size_t component>
struct ColumnOfUnpacked {
  static constexpr int of(std::size_t row) {
    const std::size_t rows = size / 4, number = 4 * (row % rows) + component, k = number % (width / 2);
    return static_cast<int>(row / (2 * rows) * size + number / width * width + 2 * k + row / rows % 2);
  }
};
/// The way back: what is to be unpacked to rows of registers 2 pair and 2 pair + 1, from columns 0 and 2, or 1 and 3.
template <std::size_t size, std::size_t width, std::size_t pair>
struct PackedRows {
  static constexpr int of(std::size_t l) {
    const std::size_t rows = size / 4, k = l % width, number = l - k + 2 * (k % (width / 2));
    const std::size_t row = (2 * pair + k / (width / 2)) * rows + number / 4;
    return static_cast<int>(number % 4 / 2 * size + row);
  }
};
/// The columns of the rows of four numbers that stand in four registers one after the other, and the way back; for
/// instructions that take any two registers' numbers in any order.
template <class P>
LIESTAT_ALWAYS_INLINE void rowsToColumns(const P (&r)[4], P (&columns)[4]) {
  constexpr std::size_t size = P::size, width = 16 / sizeof(typename P::Scalar);
  using Lower = Unpacked<size, width, false>;
  using Upper = Unpacked<size, width, true>;
  const P a[2] = {permuted<Lower>(r[0], r[1]), permuted<Upper>(r[0], r[1])},
          b[2] = {permuted<Lower>(r[2], r[3]), permuted<Upper>(r[2], r[3])};
  constexpr auto half = [](std::size_t component) { return component % width / (width / 2); };
  columns[0] = permuted<ColumnOfUnpacked<size, width, 0>>(a[half(0)], b[half(0)]);
  columns[1] = permuted<ColumnOfUnpacked<size, width, 1>>(a[half(1)], b[half(1)]);
  columns[2] = permuted<ColumnOfUnpacked<size, width, 2>>(a[half(2)], b[half(2)]);
  columns[3] = permuted<ColumnOfUnpacked<size, width, 3>>(a[half(3)], b[half(3)]);
}
template <class P>
LIESTAT_ALWAYS_INLINE void columnsToRows(const P& x, const P& y, const P& z, const P& w, P (&r)[4]) {
  constexpr std::size_t size = P::size, width = 16 / sizeof(typename P::Scalar);
  using Lower = Unpacked<size, width, false>;
  using Upper = Unpacked<size, width, true>;
  const P xz = permuted<PackedRows<size, width, 0>>(x, z), yw = permuted<PackedRows<size, width, 0>>(y, w),
          XZ = permuted<PackedRows<size, width, 1>>(x, z), YW = permuted<PackedRows<size, width, 1>>(y, w);
  r[0] = permuted<Lower>(xz, yw), r[1] = permuted<Upper>(xz, yw);
  r[2] = permuted<Lower>(XZ, YW), r[3] = permuted<Upper>(XZ, YW);
}

/// Registers whose instructions take any two registers' numbers in any order.
template <class P>
inline constexpr bool permutes = P::set == InstructionSet::avx512&& P::size >= 8;

/// A pack of 4, 8 or 16 lanes from parts, four lanes each.
template <class P>
LIESTAT_ALWAYS_INLINE P joined(const FourNumbers<typename P::Scalar>* parts, std::size_t stride) {
  P x;
  if constexpr (P::size == 4) {
    x.v = parts[0].v;
  } else if constexpr (P::size == 8) {
    x.v = __builtin_shufflevector(parts[0].v, parts[stride].v, 0, 1, 2, 3, 4, 5, 6, 7);
  } else {
    x.v = __builtin_shufflevector(
        __builtin_shufflevector(parts[0].v, parts[stride].v, 0, 1, 2, 3, 4, 5, 6, 7),
        __builtin_shufflevector(parts[2 * stride].v, parts[3 * stride].v, 0, 1, 2, 3, 4, 5, 6, 7),  //
        0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  }
  return x;
}

/// The columns of as many rows of four numbers as a pack has lanes, from where these rows are.
template <class P>
LIESTAT_ALWAYS_INLINE void transposeRows(const typename P::Scalar* const (&row)[P::size], P (&columns)[4]) {
  FourNumbers<typename P::Scalar> rows[P::size];
  LIESTAT_UNROLL for (std::size_t k = 0; k < P::size; ++k) rows[k].load(row[k]);
  P r[4];
  if constexpr (P::size == 4) {
    transpose(rows);
    LIESTAT_UNROLL for (std::size_t c = 0; c < 4; ++c) columns[c] = P(rows[c].v);
  } else if constexpr (permutes<P>) {
    LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) r[k] = joined<P>(rows + k * (P::size / 4), 1);
    rowsToColumns(r, columns);
  } else {
    static_assert(P::size == 8);
    LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) r[k] = joined<P>(rows + k, 4);
    const auto a = __builtin_shufflevector(r[0].v, r[1].v, 0, 8, 1, 9, 4, 12, 5, 13),
               b = __builtin_shufflevector(r[0].v, r[1].v, 2, 10, 3, 11, 6, 14, 7, 15),
               c = __builtin_shufflevector(r[2].v, r[3].v, 0, 8, 1, 9, 4, 12, 5, 13),
               d = __builtin_shufflevector(r[2].v, r[3].v, 2, 10, 3, 11, 6, 14, 7, 15);
    columns[0] = P(__builtin_shufflevector(a, c, 0, 1, 8, 9, 4, 5, 12, 13));
    columns[1] = P(__builtin_shufflevector(a, c, 2, 3, 10, 11, 6, 7, 14, 15));
    columns[2] = P(__builtin_shufflevector(b, d, 0, 1, 8, 9, 4, 5, 12, 13));
    columns[3] = P(__builtin_shufflevector(b, d, 2, 3, 10, 11, 6, 7, 14, 15));
  }
}
/// The same of rows that follow one another without a gap.
template <class P>
LIESTAT_ALWAYS_INLINE void transposeRows(const typename P::Scalar* rows, P (&columns)[4]) {
  if constexpr (permutes<P>) {
    P r[4];
    LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) r[k] = P::load(rows + k * P::size);
    rowsToColumns(r, columns);
  } else {
    const typename P::Scalar* row[P::size];
    LIESTAT_UNROLL for (std::size_t k = 0; k < P::size; ++k) row[k] = rows + 4 * k;
    transposeRows(row, columns);
  }
}
/// The parts of a pack of 4, 8 or 16 lanes, four at a time.
template <std::size_t part, class P>
LIESTAT_ALWAYS_INLINE void takePart(const P& x, FourNumbers<typename P::Scalar>& to) {
  if constexpr (P::size == 4) {
    to.v = x.v;
  } else {
    to.v = __builtin_shufflevector(x.v, x.v, 4 * part, 4 * part + 1, 4 * part + 2, 4 * part + 3);
  }
}
template <class P>
LIESTAT_ALWAYS_INLINE void split(const P& x, FourNumbers<typename P::Scalar>* parts, std::size_t stride) {
  takePart<0>(x, parts[0]);
  if constexpr (P::size > 4) takePart<1>(x, parts[stride]);
  if constexpr (P::size > 8) takePart<2>(x, parts[2 * stride]), takePart<3>(x, parts[3 * stride]);
}

/// Twelve numbers x0 y0 z0 x1 … z3 to x0 … x3, y0 … y3, z0 … z3, and back: each of x, y, z has one number in every
/// place of the three rows.
template <class S>
LIESTAT_ALWAYS_INLINE void separate(FourNumbers<S> (&r)[3]) {
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
LIESTAT_ALWAYS_INLINE void interleave(FourNumbers<S> (&r)[3]) {
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
LIESTAT_ALWAYS_INLINE void separate(FourNumbers<S> (&r)[2]) {
  const typename FourNumbers<S>::Vector a = r[0].v, b = r[1].v;
  r[0].v = __builtin_shufflevector(a, b, 0, 2, 4, 6);
  r[1].v = __builtin_shufflevector(a, b, 1, 3, 5, 7);
}
template <class S>
LIESTAT_ALWAYS_INLINE void interleave(FourNumbers<S> (&r)[2]) {
  const typename FourNumbers<S>::Vector x = r[0].v, y = r[1].v;
  r[0].v = __builtin_shufflevector(x, y, 0, 4, 1, 5);
  r[1].v = __builtin_shufflevector(x, y, 2, 6, 3, 7);
}

/// For `permuted`: component Component of elements of N numbers that stand one behind the other in N registers. Second 1
/// takes it from registers 0 and 1, Second 2 from what came of that and register 2.
template <std::size_t size, std::size_t N, std::size_t Component, std::size_t Second>
struct EveryNth {
  static constexpr int of(std::size_t l) {
    const std::size_t number = N * l + Component;
    if (Second == 1) return static_cast<int>(number < 2 * size ? number : 0);
    return static_cast<int>(number < Second * size ? l : number - (Second - 1) * size);
  }
};
/// The way back: register Register, by Second 1 of components 0 and 1, by Second 2 of what came of that and component 2.
template <std::size_t size, std::size_t N, std::size_t Register, std::size_t Second>
struct Interleaved {
  static constexpr int of(std::size_t l) {
    const std::size_t number = Register * size + l, element = number / N, component = number % N;
    if (component == Second) return static_cast<int>(size + element);
    return static_cast<int>(Second == 1 && component == 0 ? element : Second == 1 ? 0 : l);
  }
};
/// Elements of two or three numbers, one behind the other.
template <class P, std::size_t N>
LIESTAT_ALWAYS_INLINE void loadDense(const typename P::Scalar* from, P (&x)[N]) {
  if constexpr (permutes<P>) {
    constexpr std::size_t size = P::size;
    P r[N];
    LIESTAT_UNROLL for (std::size_t k = 0; k < N; ++k) r[k] = P::load(from + k * size);
    x[0] = permuted<EveryNth<size, N, 0, 1>>(r[0], r[1]), x[1] = permuted<EveryNth<size, N, 1, 1>>(r[0], r[1]);
    if constexpr (N == 3) {
      x[2] = permuted<EveryNth<size, N, 2, 1>>(r[0], r[1]);
      x[0] = permuted<EveryNth<size, N, 0, 2>>(x[0], r[2]), x[1] = permuted<EveryNth<size, N, 1, 2>>(x[1], r[2]);
      x[2] = permuted<EveryNth<size, N, 2, 2>>(x[2], r[2]);
    }
  } else {
    FourNumbers<typename P::Scalar> rows[P::size / 4][N];
    LIESTAT_UNROLL for (std::size_t part = 0; part < P::size / 4; ++part) {
      LIESTAT_UNROLL for (std::size_t k = 0; k < N; ++k) rows[part][k].load(from + 4 * (part * N + k));
      separate(rows[part]);
    }
    LIESTAT_UNROLL for (std::size_t k = 0; k < N; ++k) x[k] = joined<P>(&rows[0][k], N);
  }
}
template <class P, std::size_t N>
LIESTAT_ALWAYS_INLINE void storeDense(const P (&x)[N], typename P::Scalar* to) {
  if constexpr (permutes<P>) {
    constexpr std::size_t size = P::size;
    P r[N];
    r[0] = permuted<Interleaved<size, N, 0, 1>>(x[0], x[1]), r[1] = permuted<Interleaved<size, N, 1, 1>>(x[0], x[1]);
    if constexpr (N == 3) {
      r[2] = permuted<Interleaved<size, N, 2, 1>>(x[0], x[1]);
      r[0] = permuted<Interleaved<size, N, 0, 2>>(r[0], x[2]), r[1] = permuted<Interleaved<size, N, 1, 2>>(r[1], x[2]);
      r[2] = permuted<Interleaved<size, N, 2, 2>>(r[2], x[2]);
    }
    LIESTAT_UNROLL for (std::size_t k = 0; k < N; ++k) r[k].store(to + k * size);
  } else {
    FourNumbers<typename P::Scalar> rows[P::size / 4][N];
    LIESTAT_UNROLL for (std::size_t k = 0; k < N; ++k) split(x[k], &rows[0][k], N);
    LIESTAT_UNROLL for (std::size_t part = 0; part < P::size / 4; ++part) {
      interleave(rows[part]);
      LIESTAT_UNROLL for (std::size_t k = 0; k < N; ++k) rows[part][k].store(to + 4 * (part * N + k));
    }
  }
}

}  // namespace liestat::detail
#endif
