// Outer products taken off the upper triangle of a symmetric matrix: the inner loop of factoring normal equations, and of
// eliminating unknowns from them.
#pragma once

#include <lie/detail/kernel.hpp>
#include <lie/detail/pack.hpp>

#include <array>
#include <cstddef>

namespace liestat::detail {

/// M -= Σ leftᵀ right on rows [begin, rows_end) and columns [row, columns_end) of a matrix whose rows are `stride` numbers
/// apart. Rows come in threes; the stride is a whole number of the largest packs, and numbers between columns_end and the
/// next such number are zero in `right`. What is below the diagonal is overwritten by anything.
struct OuterProducts {
  static constexpr std::size_t most = 24;

  double* matrix = nullptr;
  std::size_t stride = 0, begin = 0, rows_end = 0, columns_end = 0;
  std::size_t count = 0;  ///< pairs of rows
  std::array<const double*, most> left, right;

  void add(const double* of_rows, const double* of_columns) {
    left[count] = of_rows;
    right[count++] = of_columns;
  }
};

struct OuterProductsKernel {
  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(OuterProducts& a) {
    using P = Pack<Set, double>;
    for (std::size_t i = a.begin; i < a.rows_end; i += 3) {
      // Many unknowns are tied to few others: a pair whose left row is zero here adds nothing.
      std::array<const double*, OuterProducts::most> left, right;
      std::size_t count = 0;
      for (std::size_t k = 0; k < a.count; ++k) {
        const double* row = a.left[k] + i;
        if (row[0] == 0 && row[1] == 0 && row[2] == 0) continue;
        left[count] = row;
        right[count++] = a.right[k];
      }
      if (count == 0) continue;
      double* to = a.matrix + i * a.stride;
      std::size_t j = i / P::size * P::size;
      for (; j + 3 * P::size <= a.columns_end; j += 3 * P::size) {
        addTile<P, 3>(to + j, a.stride, left.data(), right.data(), count, j);
      }
      for (; j < a.columns_end; j += P::size) addTile<P, 1>(to + j, a.stride, left.data(), right.data(), count, j);
    }
  }

 private:
  template <class P, std::size_t packs>
  LIESTAT_ALWAYS_INLINE static void addTile(double* to, std::size_t stride, const double* const* left,
                                            const double* const* right, std::size_t count, std::size_t j) {
    P sum[3][packs];
    LIESTAT_UNROLL
    for (std::size_t r = 0; r < 3; ++r) {
      LIESTAT_UNROLL
      for (std::size_t p = 0; p < packs; ++p) sum[r][p].v = P::load(to + r * stride + p * P::size).v;
    }
    for (std::size_t k = 0; k < count; ++k) {
      P column[packs];
      LIESTAT_UNROLL
      for (std::size_t p = 0; p < packs; ++p) column[p].v = P::load(right[k] + j + p * P::size).v;
      LIESTAT_UNROLL
      for (std::size_t r = 0; r < 3; ++r) {
        const P x(left[k][r]);
        LIESTAT_UNROLL
        for (std::size_t p = 0; p < packs; ++p) sum[r][p].v = sum[r][p].v - x.v * column[p].v;
      }
    }
    LIESTAT_UNROLL
    for (std::size_t r = 0; r < 3; ++r) {
      LIESTAT_UNROLL
      for (std::size_t p = 0; p < packs; ++p) sum[r][p].store(to + r * stride + p * P::size);
    }
  }
};

inline void subtract(OuterProducts& products) {
  if (products.count > 0) runKernel<OuterProductsKernel>(instructionSet(), products);
}

}  // namespace liestat::detail
