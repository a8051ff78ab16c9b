// Elements of arrays in memory to packs, one for each of their numbers, and back: as many elements as a pack has lanes,
// transposed in registers where the numbers of an element stand one behind the other.
#pragma once

#include <lie/detail/columns.hpp>
#include <lie/detail/pack.hpp>
#include <lie/detail/transpose.hpp>

#include <cstddef>

namespace liestat::detail {

#if LIESTAT_HAS_SHUFFLES
/// Components c … c + 3 of a pack of elements, one behind the other in each.
template <class P>
LIESTAT_ALWAYS_INLINE void loadFour(const Layout<const typename P::Scalar>& from, std::size_t i, std::size_t c, P* x) {
  P columns[4];
  loadRows(from, c, i, P::size, static_cast<const typename P::Scalar*>(nullptr), columns);
  LIESTAT_UNROLL for (std::size_t k = 0; k < 4; ++k) x[k] = columns[k];
}
template <class P>
LIESTAT_ALWAYS_INLINE void storeFour(const P& x, const P& y, const P& z, const P& w, std::size_t c,
                                     const Layout<typename P::Scalar>& to, std::size_t i) {
  using Row = FourNumbers<typename P::Scalar>;
  if constexpr (permutes<P>) {
    P r[4];
    columnsToRows(x, y, z, w, r);
    if (to.element == 4) [[likely]] {
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
  if (n == P::size) [[likely]] {
    if (from.element == 1) [[unlikely]] {
      LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) x[c] = P::load(from.at(i, c));
      return;
    }
#if LIESTAT_HAS_SHUFFLES
    if constexpr (P::size >= 4 && N >= 4) {
      if (from.component == 1) [[likely]] {
        LIESTAT_UNROLL for (std::size_t c = 0; c + 4 <= N; c += 4) loadFour(from, i, c, x + c);
        // Some of the last four a second time.
        if constexpr (N % 4 != 0) loadFour(from, i, N - 4, x + N - 4);
        return;
      }
    } else if constexpr (P::size >= 4 && N > 1) {
      if (from.component == 1 && from.element == N) [[likely]]
        return loadDense(from.at(i, 0), x);
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
  if (n == P::size) [[likely]] {
    if (to.element == 1) [[unlikely]] {
      LIESTAT_UNROLL for (std::size_t c = 0; c < N; ++c) x[c].store(to.at(i, c));
      return;
    }
#if LIESTAT_HAS_SHUFFLES
    if constexpr (P::size >= 4 && N >= 4) {
      if (to.component == 1) [[likely]] {
        LIESTAT_UNROLL for (std::size_t c = 0; c + 4 <= N; c += 4)
            storeFour(x[c], x[c + 1], x[c + 2], x[c + 3], c, to, i);
        if constexpr (N % 4 != 0) storeFour(x[N - 4], x[N - 3], x[N - 2], x[N - 1], N - 4, to, i);
        return;
      }
    } else if constexpr (P::size >= 4 && N > 1) {
      if (to.component == 1 && to.element == N) [[likely]]
        return storeDense(x, to.at(i, 0));
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
