#pragma once

// Where the work is done. Estimators and Monte-Carlo runs are written against the concept Executor and know no threads
// and no ranks: stats/compat/tbb.hpp and stats/compat/mpi.hpp are drop-in replacements for SerialExecutor.
//
// Floating-point addition is not associative. So the work is cut into chunks whose number depends on the data alone,
// never on the machine, and the chunks' results are combined one after the other in the order 0, 1, 2, …: the same bits
// come out on one thread, eight threads or four ranks (of one binary with one libm).

#include <lie/instruction_set.hpp>

#include <algorithm>
#include <concepts>
#include <cstddef>
#include <functional>
#include <type_traits>
#include <utility>

namespace liestat {

/// Half-open range of indices [begin, end).
struct ChunkRange {
  std::size_t begin = 0;
  std::size_t end = 0;

  std::size_t size() const { return end - begin; }
  friend bool operator==(const ChunkRange&, const ChunkRange&) = default;
};

/// The chunk size used where a caller has no reason for another one: large enough to hide a task's overhead behind
/// a thousand small terms, small enough to keep many threads busy on a hundred thousand of them.
inline constexpr std::size_t default_chunk_size = 1024;

/// Number of chunks for n items of at most chunk_size items each; a function of the data alone, see above.
/// chunk_size = 0 is taken as 1.
constexpr std::size_t chunkCount(std::size_t n, std::size_t chunk_size = default_chunk_size) {
  const std::size_t size = std::max<std::size_t>(chunk_size, 1);
  return n / size + (n % size != 0);
}

/// The indices of chunk number `chunk` when n items are cut into n_chunks consecutive chunks whose sizes differ by one
/// at most, the larger ones first. Empty for chunk >= n_chunks.
constexpr ChunkRange chunkRange(std::size_t n, std::size_t n_chunks, std::size_t chunk) {
  if (chunk >= n_chunks) return {n, n};
  const std::size_t size = n / n_chunks;
  const std::size_t larger = n % n_chunks;
  const std::size_t begin = chunk * size + std::min(chunk, larger);
  return {begin, begin + size + (chunk < larger)};
}

namespace detail {

/// What a chunk's map returns, by value.
template <class Map>
using ChunkResult = std::remove_cvref_t<std::invoke_result_t<Map&, std::size_t>>;

/// A combine that works in place: returns nothing, or the left argument by reference.
template <class Combine, class T>
concept InPlaceCombine = std::invocable<Combine&, T&, const T&> &&
    (std::is_void_v<std::invoke_result_t<Combine&, T&, const T&>> ||
     std::same_as<std::invoke_result_t<Combine&, T&, const T&>, T&>);

/// left <- left combined with right, for both shapes of combine.
template <class Combine, class T>
void combineInto(Combine& combine, T& left, T right) {
  if constexpr (InPlaceCombine<Combine, T>) {
    std::invoke(combine, left, std::as_const(right));
  } else {
    left = std::invoke(combine, std::move(left), std::move(right));
  }
}

/// Archetypes with which the concept Executor is asked.
struct MapArchetype {
  double operator()(std::size_t) const { return 0; }
};
struct CombineArchetype {
  void operator()(double&, const double&) const {}
};

}  // namespace detail

/// Evaluates a reduction over chunks: `reduce(n_chunks, map, combine)` returns
/// combine(… combine(combine(map(0), map(1)), map(2)) …, map(n_chunks - 1)).
///
/// - `map(std::size_t chunk) -> T` is called once for each chunk, on any thread, several at the same time: it must not
///   write to anything shared. T is movable and default constructible.
/// - `combine` is `void(T&, const T&)`, which works in place, or `T(T, T)`. It is never called twice at the same time,
///   and always in the order of the chunks; it need be neither commutative nor associative.
/// - n_chunks == 0 returns T{} (zero for numbers) and calls nothing.
/// - An exception of map or combine leaves reduce; chunks that have not begun then may never be evaluated.
template <class E>
concept Executor = requires(const E& executor, std::size_t n_chunks, detail::MapArchetype map,
                            detail::CombineArchetype combine) {
  { executor.reduce(n_chunks, map, combine) } -> std::same_as<double>;
};

/// The calling thread does everything, in order, holding two chunks' results at a time.
struct SerialExecutor {
  template <class Map, class Combine>
  detail::ChunkResult<Map> reduce(std::size_t n_chunks, Map&& map, Combine&& combine) const {
    using T = detail::ChunkResult<Map>;
    if (n_chunks == 0) return T{};
    T result = std::invoke(map, std::size_t{0});
    for (std::size_t chunk = 1; chunk < n_chunks; ++chunk) {
      detail::combineInto(combine, result, T(std::invoke(map, chunk)));
    }
    return result;
  }
};

static_assert(Executor<SerialExecutor>);

/// The instructions of the kernels that run under an executor: those that it has agreed on, where processes on several
/// machines work together (executor.instructionSet()), else those of the process.
template <Executor E>
InstructionSet instructionSetOf(const E& executor) {
  if constexpr (requires { executor.instructionSet(); }) {
    return executor.instructionSet();
  } else {
    return instructionSet();
  }
}

}  // namespace liestat
