// One operation on every element of an array, a register of elements at a time: the loop around the formulas of
// lie/detail/array_rotations.hpp and its neighbours.
//
// An operation is a class with
//   a, b, out          how many numbers an element of its operands and of its result has; b = 0 if there is one operand
//   rows               of a result that is a matrix, by columns; else 0
//   apply(a, b, out)   the result of a register of elements; numbers of a matrix that it does not write are zero
// and where there are elements that cost more than the others, of the one operand a,
//   special(a)         the mask of those elements
//   prepare<any>(a, c) some numbers that apply takes for b; any: some of the elements are special
// An element's result does not depend on the elements beside it: prepare<true> treats special lanes alone in another
// way, and what follows is one code for both, which the compiler fuses in one way. prepare has no sums of two products:
// it is open which of them is fused.
#pragma once

#include <lie/detail/kernel.hpp>
#include <lie/detail/pack_elements.hpp>

#include <cstddef>

namespace liestat::detail {

/// An operation with one variant.
template <std::size_t A, std::size_t B, std::size_t Out, std::size_t Rows = 0>
struct ArrayOperation {
  static constexpr std::size_t a = A, b = B, out = Out, rows = Rows;
  static constexpr bool variants = false;
};

template <class Operation, class S>
struct ArrayKernel {
  struct Arguments {
    Layout<const S> a, b;  ///< an operand whose elements are at distance 0 is one element for all
    Layout<S> out;
    std::size_t count = 0;  ///< not zero
    bool by_rows = false;   ///< matrices
  };

  template <InstructionSet Set>
  LIESTAT_ALWAYS_INLINE static void run(Arguments& arguments) {
    using P = Pack<Set, S>;
    P a[Operation::a], b[Operation::b == 0 ? 1 : Operation::b], out[Operation::out];
    [[maybe_unused]] unsigned char order[Operation::out];
    if constexpr (Operation::rows != 0) {
      constexpr std::size_t rows = Operation::rows, columns = Operation::out / rows;
      LIESTAT_UNROLL for (P& x : out) x = P::zero();
      for (std::size_t c = 0; c < Operation::out; ++c) {
        order[c] = static_cast<unsigned char>(arguments.by_rows ? c % columns * rows + c / columns : c);
      }
    }
    // The compiler must not suspect that stores change them.
    const Layout<const S> from_a = arguments.a, from_b = arguments.b;
    const Layout<S> to = arguments.out;
    const std::size_t count = arguments.count;
    loadOne(from_a, a);
    if constexpr (Operation::b != 0) {
      loadOne(from_b, b);
    } else {
      b[0] = P::zero();
    }
    for (std::size_t i = 0; i < count; i += P::size) {
      const std::size_t n = count - i < P::size ? count - i : P::size;
      if (from_a.element != 0) loadElements(from_a, i, n, a);
      if (Operation::b != 0 && from_b.element != 0) loadElements(from_b, i, n, b);
      if constexpr (Operation::variants) {
        P coefficients[Operation::coefficients];
        if (anyOf(Operation::special(a))) {
          Operation::template prepare<true>(a, coefficients);
        } else {
          Operation::template prepare<false>(a, coefficients);
        }
#if defined(__clang__)
        // Else clang 14 fuses what follows in another way for each branch.
        asm volatile("" : "+m"(coefficients));
#endif
        Operation::apply(a, coefficients, out);
      } else {
        Operation::apply(a, b, out);
      }
      if constexpr (Operation::rows == 0) {
        storeElements(out, to, i, n);
      } else {
        storeMatrices(out, order, to, i, n);
      }
    }
  }
};

}  // namespace liestat::detail
