// Elements of arrays in memory to packs, one for each of their numbers, and back: as many elements as a pack has lanes,
// transposed in registers where the numbers of an element stand one behind the other.
#pragma once

#include <lie/detail/columns.hpp>
#include <lie/detail/pack.hpp>

#include <cstddef>

namespace liestat::detail {

#if LIESTAT_HAS_SHUFFLES
/// The parts of a pack of 4, 8 or 16 lanes, four at a time.
template <class P>
LIESTAT_ALWAYS_INLINE P joined(const FourNumbers<typename P::Scalar>* parts, std::size_t stride) {
  if constexpr (P::size == 4) {
    return P(parts[0].v);
  } else if constexpr (P::size == 8) {
    return P(__builtin_shufflevector(parts[0].v, parts[stride].v, 0, 1, 2, 3, 4, 5, 6, 7));
  } else {
    return P(__builtin_shufflevector(
        __builtin_shufflevector(parts[0].v, parts[stride].v, 0, 1, 2, 3, 4, 5, 6, 7),
        __builtin_shufflevector(parts[2 * stride].v, parts[3 * stride].v, 0, 1, 2, 3, 4, 5, 6, 7),  //
        0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
  }
}
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

/// Registers whose instructions take any two registers' numbers in any order.
template <class P>
inline constexpr bool permutes = P::set == InstructionSet::avx512&& P::size >= 8;

/// Components c … c + 3 of a pack of elements, one behind the other in each.
template <class P>
LIESTAT_ALWAYS_INLINE void loadFour(const Layout<const typename P::Scalar>& from, std::size_t i, std::size_t c, P* x) {
  using Row = FourNumbers<typename P::Scalar>;
  if constexpr (permutes<P>) {
    P r[4], columns[4];
    if (from.element == 4) {
      LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) {
        const auto* const rows = from.at(i, c) + k * P::size;
        r[k] = P::load(rows);
        prefetch(rows);
      }
    } else {
      Row row[P::size];
      LIESTAT_UNROLL for (std::size_t k = 0; k < P::size; ++k) {
        row[k].load(from.at(i + k, c));
        if (c == 0) prefetch(from.at(i + k, c));
      }
      LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) r[k] = joined<P>(row + k * (P::size / 4), 1);
    }
    rowsToColumns(r, columns);
    LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) x[k] = columns[k];
  } else {
    Row rows[P::size / 4][4];
    LIESTAT_UNROLL for (std::size_t part = 0; part < P::size / 4; ++part) {
      LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) rows[part][k].load(from.at(i + 4 * part + k, c));
      transpose(rows[part]);
    }
    LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) x[k] = joined<P>(&rows[0][k], 4);
  }
}
template <class P>
LIESTAT_ALWAYS_INLINE void storeFour(const P& x, const P& y, const P& z, const P& w, std::size_t c,
                                     const Layout<typename P::Scalar>& to, std::size_t i) {
  using Row = FourNumbers<typename P::Scalar>;
  if constexpr (permutes<P>) {
    P r[4];
    columnsToRows(x, y, z, w, r);
    if (to.element == 4) {
      LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) r[k].store(to.at(i, c) + k * P::size);
    } else {
      Row row[P::size];
      LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) split(r[k], row + k * (P::size / 4), 1);
      LIESTAT_UNROLL for (std::size_t k = 0; k < P::size; ++k) row[k].store(to.at(i + k, c));
    }
  } else {
    Row rows[P::size / 4][4];
    split(x, &rows[0][0], 4), split(y, &rows[0][1], 4), split(z, &rows[0][2], 4), split(w, &rows[0][3], 4);
    LIESTAT_UNROLL for (std::size_t part = 0; part < P::size / 4; ++part) {
      transpose(rows[part]);
      LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) rows[part][k].store(to.at(i + 4 * part + k, c));
    }
  }
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
#endif

/// One element in every lane.
template <class P, std::size_t N>
LIESTAT_ALWAYS_INLINE void loadOne(const Layout<const typename P::Scalar>& from, P (&x)[N]) {
  LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) {
    typename P::Scalar lanes[P::size];
    for (std::size_t l = 0; l < P::size; ++l) lanes[l] = *from.at(0, c);
    x[c] = P::load(lanes);
  }
}

/// Elements i … i + n - 1, n <= P::size, of N numbers each; where there are fewer than lanes the last is repeated.
template <class P, std::size_t N>
LIESTAT_ALWAYS_INLINE void loadElements(const Layout<const typename P::Scalar>& from, std::size_t i, std::size_t n,
                                        P (&x)[N]) {
  using S = typename P::Scalar;
  if (n == P::size) {
    if (from.element == 1) {
      LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) x[c] = P::load(from.at(i, c));
      return;
    }
#if LIESTAT_HAS_SHUFFLES
    if constexpr (P::size >= 4 && N >= 4) {
      if (from.component == 1) {
        LIESTAT_UNROLL for (std::size_t c = 0; c + 4 <= N; c += 4) loadFour(from, i, c, x + c);
        // Some of the last four a second time.
        if constexpr (N % 4 != 0) loadFour(from, i, N - 4, x + N - 4);
        return;
      }
    } else if constexpr (P::size >= 4 && N > 1) {
      if (from.component == 1 && from.element == N) return loadDense(from.at(i, 0), x);
    }
#endif
  }
  if constexpr (P::size == 2) {
    // Without a way through memory, which costs more than half a register gains.
    LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) {
      x[c].v = typename P::Vector{*from.at(i, c), *from.at(i + n - 1, c)};
    }
  } else {
    S lanes[N][P::size];
    for (std::size_t l = 0; l < P::size; ++l) {
      const std::size_t element = i + (l < n ? l : n - 1);
      for (std::size_t c = 0; c < N; ++c) lanes[c][l] = *from.at(element, c);
    }
    LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) x[c] = P::load(lanes[c]);
  }
}

/// Number by number, of n elements.
template <class P>
LIESTAT_ALWAYS_INLINE void storeLanes(const P& x, const Layout<typename P::Scalar>& to, std::size_t i, std::size_t c,
                                      std::size_t n) {
  if constexpr (P::size == 2) {
    *to.at(i, c) = x.v[0];
    if (n == 2) *to.at(i + 1, c) = x.v[1];
  } else {
    typename P::Scalar lanes[P::size];
    x.store(lanes);
    for (std::size_t l = 0; l < n; ++l) *to.at(i + l, c) = lanes[l];
  }
}

/// The way back.
template <class P, std::size_t N>
LIESTAT_ALWAYS_INLINE void storeElements(const P (&x)[N], const Layout<typename P::Scalar>& to, std::size_t i,
                                         std::size_t n) {
  if (n == P::size) {
    if (to.element == 1) {
      LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) x[c].store(to.at(i, c));
      return;
    }
#if LIESTAT_HAS_SHUFFLES
    if constexpr (P::size >= 4 && N >= 4) {
      if (to.component == 1) {
        LIESTAT_UNROLL for (std::size_t c = 0; c + 4 <= N; c += 4)
            storeFour(x[c], x[c + 1], x[c + 2], x[c + 3], c, to, i);
        if constexpr (N % 4 != 0) storeFour(x[N - 4], x[N - 3], x[N - 2], x[N - 1], N - 4, to, i);
        return;
      }
    } else if constexpr (P::size >= 4 && N > 1) {
      if (to.component == 1 && to.element == N) return storeDense(x, to.at(i, 0));
    }
#endif
  }
  LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) storeLanes(x[c], to, i, c, n);
}

/// Matrices, whose numbers stay in memory: number c of an element is x[order[c]].
template <class P, std::size_t N>
LIESTAT_ALWAYS_INLINE void storeMatrices(const P (&x)[N], const unsigned char (&order)[N],
                                         const Layout<typename P::Scalar>& to, std::size_t i, std::size_t n) {
#if LIESTAT_HAS_SHUFFLES
  if constexpr (P::size >= 4 && N >= 4) {
    if (n == P::size && to.component == 1) {
      for (std::size_t c = 0; c < N; c += 4) {
        const std::size_t k = c + 4 <= N ? c : N - 4;
        storeFour(x[order[k]], x[order[k + 1]], x[order[k + 2]], x[order[k + 3]], k, to, i);
      }
      return;
    }
  }
#endif
  for (std::size_t c = 0; c < N; ++c) {
    if (n == P::size && to.element == 1) {
      x[order[c]].store(to.at(i, c));
    } else {
      storeLanes(x[order[c]], to, i, c, n);
    }
  }
}

}  // namespace liestat::detail
