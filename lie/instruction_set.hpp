// The instructions that the kernels over arrays use, chosen once while the program runs: a program built for plain
// x86-64 uses AVX2 or AVX-512 where the processor has them. What is done with one element at a time is compiled for
// whatever its unit is compiled for.
//
// Sums have the same bits on any number of threads and ranks with one set, and differ by rounding between two. To have
// them equal on different processors, fix the choice: by the environment variable LIESTAT_INSTRUCTION_SET (baseline,
// avx2 or avx512), or by useInstructionSet().
#pragma once

#include <atomic>
#include <cstdlib>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>

namespace liestat {

/// Sets of instructions, each with all of those before it.
enum class InstructionSet {
  baseline,  ///< every processor of the architecture: SSE2, NEON; registers of 16 bytes
  avx2,      ///< AVX2 and FMA; registers of 32 bytes
  avx512     ///< AVX-512 F, DQ, BW and VL; registers of 64 bytes
};

/// The word for it, as the environment variable takes it.
constexpr const char* name(InstructionSet set) {
  return set == InstructionSet::avx512 ? "avx512" : set == InstructionSet::avx2 ? "avx2" : "baseline";
}
/// The set that a word names, or nothing.
constexpr std::optional<InstructionSet> instructionSetByName(std::string_view word) {
  for (const InstructionSet set : {InstructionSet::baseline, InstructionSet::avx2, InstructionSet::avx512}) {
    if (word == name(set)) return set;
  }
  return std::nullopt;
}

// The compilers that make functions for other instructions than those of their unit.
#if defined(__x86_64__) && defined(__GNUC__)
#define LIESTAT_HAS_DISPATCH 1
#else
#define LIESTAT_HAS_DISPATCH 0
#endif

/// The largest set that this processor and its operating system support.
inline InstructionSet supportedInstructionSet() {
#if LIESTAT_HAS_DISPATCH
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512vl")) {
      return InstructionSet::avx512;
    }
    return InstructionSet::avx2;
  }
#endif
  return InstructionSet::baseline;
}

namespace detail {

[[noreturn]] inline void refuseInstructionSet(const std::string& origin, const std::string& word) {
  throw std::invalid_argument(origin + word + ": expected baseline, avx2 or avx512, at most " +
                              name(supportedInstructionSet()) + ", which is what this processor supports");
}

/// The set that LIESTAT_INSTRUCTION_SET names, or the largest set there is.
inline InstructionSet initialInstructionSet() {
  constexpr const char* variable = "LIESTAT_INSTRUCTION_SET";
  const InstructionSet supported = supportedInstructionSet();
  const char* const word = std::getenv(variable);
  if (word == nullptr || *word == '\0') return supported;
  const std::optional<InstructionSet> set = instructionSetByName(word);
  if (!set || *set > supported) refuseInstructionSet(std::string(variable) + "=", word);
  return *set;
}

inline std::atomic<InstructionSet>& chosenInstructionSet() {
  static std::atomic<InstructionSet> set{initialInstructionSet()};
  return set;
}

}  // namespace detail

/// The set in use. Throws std::invalid_argument if the environment variable names none that the processor supports.
inline InstructionSet instructionSet() { return detail::chosenInstructionSet().load(std::memory_order_relaxed); }

/// Fixes the set for the whole program, from now on; for use before the first estimate, so that all have one.
/// Throws std::invalid_argument for a set that this processor does not support.
inline void useInstructionSet(InstructionSet set) {
  if (set > supportedInstructionSet()) detail::refuseInstructionSet("useInstructionSet: ", name(set));
  detail::chosenInstructionSet().store(set, std::memory_order_relaxed);
}

}  // namespace liestat
