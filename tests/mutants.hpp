// The switch of tests/mutants.sh, which copies this header and includes it wherever it plants a fault; no other build
// reads it. LIESTAT_MUTANT=<number> switches one fault on; LIESTAT_MUTANTS_REACHED=<directory> makes each process write
// there, into a file of its own, the numbers of the faults whose lines it reaches.
#pragma once

#include <atomic>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <string>
#include <type_traits>
#include <unistd.h>

namespace liestat_mutants {

inline const char* const reached_directory = std::getenv("LIESTAT_MUTANTS_REACHED");
/// The fault that is switched on; 0 is none, and 1 is none but says what is reached.
inline const std::uint32_t chosen = [] {
  const char* number = std::getenv("LIESTAT_MUTANT");
  if (number != nullptr) return static_cast<std::uint32_t>(std::strtoul(number, nullptr, 16));
  return std::uint32_t{reached_directory != nullptr ? 1U : 0U};
}();

/// Written at once, since processes that a test starts may end in any way.
__attribute__((noinline, cold)) inline bool reached(std::uint32_t id, std::atomic<bool>& known) {
  if (known.exchange(true)) return false;
  const std::string path = std::string(reached_directory) + "/" + std::to_string(::getpid());
  char line[16];
  const int length = std::snprintf(line, sizeof line, "%08x\n", id);
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (file < 0 || ::write(file, line, static_cast<std::size_t>(length)) != length) std::abort();
  ::close(file);
  return false;
}

template <std::uint32_t Id>
inline std::atomic<bool> is_known{false};

// Inlined by force: kernels for several instruction sets evaluate both.
template <std::uint32_t Id>
__attribute__((always_inline)) inline constexpr bool on() {
  if (std::is_constant_evaluated()) return false;
  return chosen == Id || (chosen == 1 && reached(Id, is_known<Id>));
}

/// The dense matrix by columns of a type of matrix, whatever order and limits its expression suggests.
template <class T>
struct PlainOf;
template <template <class, int, int, int, int, int> class M, class S, int R, int C, int O, int MR, int MC>
struct PlainOf<M<S, R, C, O, MR, MC>> {
  using type = M<S, R, C, (R == 1 && C != 1 ? 1 : 0), R, C>;
};

/// A value of its own, so that two expressions of one value have one type.
template <class T>
__attribute__((always_inline)) inline constexpr auto plain(const T& x) {
  if constexpr (requires { typename T::PlainObject; }) {
    return typename PlainOf<typename T::PlainObject>::type(x);
  } else {
    return T(x);
  }
}

}  // namespace liestat_mutants
