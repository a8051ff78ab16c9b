// Kernels over arrays, compiled once for each instruction set and chosen while the program runs.
//
// A kernel is a class with a template<InstructionSet> static run(Arguments&), inlined by force, and so must be
// everything that it calls: a function that is not, a lambda above all, is compiled for the unit's instructions without
// a word. The entries below are never inlined, so a program has one of each, whatever flags its units have.
#pragma once

#include <lie/detail/always_inline.hpp>
#include <lie/instruction_set.hpp>

namespace liestat::detail {

template <class Kernel, class Arguments>
LIESTAT_NO_INLINE void runBaseline(Arguments& arguments) {
  Kernel::template run<InstructionSet::baseline>(arguments);
}
#if LIESTAT_HAS_DISPATCH
template <class Kernel, class Arguments>
__attribute__((target("avx2,fma"))) LIESTAT_NO_INLINE void runAvx2(Arguments& arguments) {
  Kernel::template run<InstructionSet::avx2>(arguments);
}
template <class Kernel, class Arguments>
__attribute__((target("avx2,fma,avx512f,avx512dq,avx512bw,avx512vl"))) LIESTAT_NO_INLINE void runAvx512(
    Arguments& arguments) {
  Kernel::template run<InstructionSet::avx512>(arguments);
}
#endif

/// Runs a kernel with the instructions of a set, which the processor must support.
template <class Kernel, class Arguments>
void runKernel([[maybe_unused]] InstructionSet set, Arguments& arguments) {
#if LIESTAT_HAS_DISPATCH
  if (set == InstructionSet::avx512) return runAvx512<Kernel>(arguments);
  if (set == InstructionSet::avx2) return runAvx2<Kernel>(arguments);
#endif
  runBaseline<Kernel>(arguments);
}

}  // namespace liestat::detail
