// The scatter of products: Σ p z zᵀ of residuals z that kernels of the factors have stored, with its blocks of two
// factors, a square of 3 × 3 entries at a time in registers. The number of coordinates is an argument, so that all
// products share these kernels.
#pragma once

#include <lie/detail/kernel.hpp>
#include <lie/detail/pack.hpp>
#include <stats/detail/moment_kernel.hpp>

#include <cstddef>

namespace liestat::detail {

/// Columns in multiples of this many; surplus ones are zero.
inline constexpr std::size_t scatter_tile = 3;
/// The numbers of a column are zero between the last residual and the next multiple of this: the largest register's.
inline constexpr std::size_t largest_pack = 64 / sizeof(float);

template <class S, bool Weighted>
struct ScatterKernel {
  struct Arguments {
    ResidualColumns<S> residuals = nullptr;
    const S* weights = nullptr;  ///< one for each number of a column
    const S* metric = nullptr;   ///< weight of each column's square in the squared length
    std::size_t columns = 0, count = 0;
    /// The lower triangle of a matrix of columns × columns, row by row, to which nothing is added.
    S *scatter = nullptr, *squared = nullptr;
    S largest;  ///< squared length
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    using P = Pack<Set, S>;
    for (std::size_t a = 0; a < arguments.columns; a += scatter_tile) {
      for (std::size_t b = 0; b <= a; b += scatter_tile) {
        addTile<P, Weighted ? 1 : 0>(arguments, a, b, arguments.scatter);
        if constexpr (Weighted) addTile<P, 2>(arguments, a, b, arguments.squared);
      }
    }
    P largest = P::zero();
    for (std::size_t j = 0; j < arguments.count; j += P::size) {
      P length2 = P::zero();
      for (std::size_t c = 0; c < arguments.columns; ++c) {
        const P z = P::load(arguments.residuals[c] + j);
        length2 += arguments.metric[c] * (z * z);
      }
      largest = larger(length2, largest);
    }
    arguments.largest = largestOf(largest);
  }

 private:
  /// The entries of three rows and three columns of Σ p^Power z zᵀ.
  template <class P, int Power>
  LIESTAT_ALWAYS_INLINE static void addTile(const Arguments& arguments, std::size_t row, std::size_t column, S* to) {
    constexpr std::size_t n = scatter_tile;
    const ResidualColumns<S> rows = arguments.residuals + row, columns = arguments.residuals + column;
    P sums[n * n];
    LIESTAT_UNROLL for (P& x : sums) x = P::zero();
    for (std::size_t j = 0; j < arguments.count; j += P::size) {
      P a[n], b[n];
      LIESTAT_UNROLL for (std::size_t c = 0; c < n; ++c) a[c] = P::load(rows[c] + j), b[c] = P::load(columns[c] + j);
      if constexpr (Power > 0) {
        const P p = P::load(arguments.weights + j);
        LIESTAT_UNROLL for (std::size_t c = 0; c < n; ++c) {
          a[c] *= p;
          if constexpr (Power > 1) b[c] *= p;
        }
      }
      LIESTAT_UNROLL for (std::size_t e = 0; e < n * n; ++e) sums[e] += a[e / n] * b[e % n];
    }
    for (std::size_t e = 0; e < n * n; ++e) to[(row + e / n) * arguments.columns + column + e % n] = sumOf(sums[e]);
  }
};

}  // namespace liestat::detail
