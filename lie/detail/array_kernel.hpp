// One operation on every element of an array, a register of elements at a time: the loop around the formulas of
// lie/detail/array_rotations.hpp and its neighbours.
//
// An operation is a class with
//   a, b, out          how many numbers an element of its operands and of its result has; b = 0 if there is one operand
//   rows               of a result that is a matrix, by columns; else 0
//   sparse             some numbers of the result are never written: they are zero
//   variant(a, n)      0 or 1 for n elements: which apply<variant> holds for all of them
//   apply<variant>     reads one register of elements, then writes the result, for the two may be one memory
// An element's result does not depend on the elements beside it: where variants differ, they do so lane by lane.
#pragma once

#include <lie/detail/columns.hpp>
#include <lie/detail/kernel.hpp>
#include <lie/detail/pack.hpp>

#include <cstddef>

namespace liestat::detail {

/// Numbers of a register of elements, one column for each.
template <class P>
struct ColumnReader {
  using Pack = P;
  const typename P::Scalar* const* column;
  std::size_t j = 0;

  LIESTAT_ALWAYS_INLINE P operator()(std::size_t c) const { return P::load(column[c] + j); }
};
template <class P>
struct ColumnWriter {
  typename P::Scalar* const* column;
  std::size_t j = 0;

  LIESTAT_ALWAYS_INLINE void operator()(std::size_t c, const P& x) const { x.store(column[c] + j); }
};

/// An operation with one variant.
struct OneVariant {
  static constexpr int variants = 1;
};

template <class Operation, class S>
struct ArrayKernel {
  struct Arguments {
    Layout<const S> a, b;  ///< an operand whose elements are at distance 0 is one element for all
    Layout<S> out;
    std::size_t count = 0;
    bool by_rows = false;  ///< matrices
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    using P = Pack<Set, S>;
    alignas(64) S a[Operation::a][block], b[operands_b][block], out[Operation::out][block];
    const S *a_columns[Operation::a], *b_columns[operands_b];
    S* out_columns[Operation::out];
    if constexpr (Operation::sparse) {
      for (std::size_t c = 0; c < Operation::out; ++c) {
        for (std::size_t j = 0; j < block; ++j) out[c][j] = 0;
      }
    }
    for (std::size_t i = 0; i < arguments.count; i += block) {
      const std::size_t n = arguments.count - i < block ? arguments.count - i : block;
      read<P, Operation::a>(arguments.a, i, n, a, a_columns);
      if constexpr (Operation::b != 0) read<P, Operation::b>(arguments.b, i, n, b, b_columns);
      const bool in_place = !Operation::sparse && arguments.out.element == 1 && n % P::size == 0;
      for (std::size_t c = 0; c < Operation::out; ++c) {
        const std::size_t d = arguments.by_rows ? transposed(c) : c;
        out_columns[c] = in_place ? arguments.out.at(i, d) : out[d];
      }
      apply<P>(a_columns, b_columns, out_columns, n);
      if (!in_place) storeColumns<Set, Operation::out>(out, arguments.out, 0, i, n);
    }
  }

 private:
  static constexpr std::size_t block = 64, operands_b = Operation::b == 0 ? 1 : Operation::b;

  /// Where number c of a matrix by columns is in one by rows.
  LIESTAT_ALWAYS_INLINE static std::size_t transposed(std::size_t c) {
    if constexpr (Operation::rows == 0) {
      return c;
    } else {
      return c % Operation::rows * (Operation::out / Operation::rows) + c / Operation::rows;
    }
  }

  /// The columns of n elements: in their own memory, or copied, with the last element repeated to the end of a register.
  template <class P, std::size_t N>
  LIESTAT_ALWAYS_INLINE static void read(const Layout<const S>& from, std::size_t i, std::size_t n, S (*copy)[block],
                                         const S* (&columns)[N]) {
    if (from.element == 1 && n % P::size == 0) {
      for (std::size_t c = 0; c < N; ++c) columns[c] = from.at(i, c);
      return;
    }
    for (std::size_t c = 0; c < N; ++c) columns[c] = copy[c];
    if (from.element == 0 && i != 0) return;
    loadColumns<P::set, N>(from, 0, i, n, copy);
    for (std::size_t j = n; j % P::size != 0; ++j) {
      for (std::size_t c = 0; c < N; ++c) copy[c][j] = copy[c][n - 1];
    }
  }

  template <class P>
  LIESTAT_ALWAYS_INLINE static void apply(const S* const* a, const S* const* b, S* const* out, std::size_t n) {
    if constexpr (Operation::variants == 1) {
      applyVariant<0, P>(a, b, out, n);
    } else if (Operation::variant(ColumnReader<P>{a}, n)) {
      applyVariant<1, P>(a, b, out, n);
    } else {
      applyVariant<0, P>(a, b, out, n);
    }
  }
  template <int Variant, class P>
  LIESTAT_ALWAYS_INLINE static void applyVariant(const S* const* a, const S* const* b, S* const* out, std::size_t n) {
    for (std::size_t j = 0; j < n; j += P::size) {
      Operation::template apply<Variant>(ColumnReader<P>{a, j}, ColumnReader<P>{b, j}, ColumnWriter<P>{out, j});
    }
  }
};

}  // namespace liestat::detail
