#pragma once

#include <stats/executor.hpp>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <optional>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::experiments {

/// The largest number of chunks that runInOrder() has under way, between evaluate(chunk) and the end of finish(chunk).
std::size_t mostUnderWay(int threads);

/// Calls evaluate(chunk) for 0 … n_chunks - 1 on several threads, and finish(chunk) after it in the order of the chunks,
/// never twice at the same time. The first exception leaves it.
void runInOrder(int threads, std::size_t n_chunks, const std::function<void(std::size_t)>& evaluate,
                const std::function<void(std::size_t)>& finish);

/// The executor of the program and of its experiments: `threads` threads (0: as many as the machine has) where they were
/// built with oneTBB, else the calling thread. oneTBB is compiled in one unit and in no header.
struct ProgramExecutor {
  int threads = 0;

  template <class Map, class Combine>
  auto reduce(std::size_t n_chunks, Map&& map, Combine&& combine) const {
    using T = std::remove_cvref_t<std::invoke_result_t<Map&, std::size_t>>;
    if (n_chunks == 0) return T{};
    // Chunks leave in the order in which they came, so those under way are consecutive and each has a slot of its own.
    std::vector<std::optional<T>> slots(std::min(n_chunks, mostUnderWay(threads)));
    std::optional<T> result;
    runInOrder(
        threads, n_chunks, [&](std::size_t chunk) { slots[chunk % slots.size()].emplace(std::invoke(map, chunk)); },
        [&](std::size_t chunk) {
          std::optional<T>& part = slots[chunk % slots.size()];
          if (result) {
            // As any executor combines two chunks.
            result = SerialExecutor{}.reduce(
                2, [&](std::size_t k) { return T(std::move(k == 0 ? *result : *part)); }, combine);
          } else {
            result.emplace(std::move(*part));
          }
          part.reset();
        });
    return T(std::move(*result));
  }
};

static_assert(Executor<ProgramExecutor>);

}  // namespace liestat::experiments
