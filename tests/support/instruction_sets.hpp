// The instruction sets that a test of kernels tries.
#pragma once

#include <lie/instruction_set.hpp>

#include <vector>

namespace liestat::test {

/// The sets that this processor supports.
inline std::vector<InstructionSet> instructionSets() {
  std::vector<InstructionSet> sets;
  for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512}) {
    if (set <= supportedInstructionSet()) sets.push_back(set);
  }
  return sets;
}

}  // namespace liestat::test
