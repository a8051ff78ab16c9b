#pragma once

// Threads of this machine (needs oneTBB, Debian: libtbb-dev; link with -ltbb or TBB::tbb).

#include <stats/executor.hpp>

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

namespace liestat {

/// Chunks are evaluated by `threads` threads (0 or less: as many as the machine has), and combined in order as they
/// come. At most four results for each thread wait at any time, whatever the number of chunks.
struct TbbExecutor {
  int threads = 0;

  template <class Map, class Combine>
  detail::ChunkResult<Map> reduce(std::size_t n_chunks, Map&& map, Combine&& combine) const {
    using T = detail::ChunkResult<Map>;
    if (n_chunks == 0) return T{};

    const int machine = tbb::info::default_concurrency();
    const int n_threads = threads > 0 ? threads : machine;
    // More threads than processors are possible only when asked for. (The control concerns the whole process, so it is
    // left alone otherwise; where several are alive the smallest one counts.)
    std::optional<tbb::global_control> more;
    if (n_threads > machine) {
      more.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(n_threads));
    }

    // Only numbers travel through the pipeline: items with destructors leak from it when an exception ends it early.
    // Chunks leave in the order in which they came and at most `window` are under way, so these are consecutive and
    // each has a slot of its own.
    const std::size_t window = static_cast<std::size_t>(n_threads) * 4;
    std::vector<std::optional<T>> slots(std::min(window, n_chunks));
    std::optional<T> result;
    std::size_t next = 0;
    const auto number = [&](tbb::flow_control& control) -> std::size_t {
      if (next == n_chunks) {
        control.stop();
        return 0;
      }
      return next++;
    };
    const auto evaluate = [&](std::size_t chunk) {
      slots[chunk % slots.size()].emplace(std::invoke(map, chunk));
      return chunk;
    };
    const auto accumulate = [&](std::size_t chunk) {
      std::optional<T>& part = slots[chunk % slots.size()];
      if (result) {
        detail::combineInto(combine, *result, std::move(*part));
      } else {
        result.emplace(std::move(*part));
      }
      part.reset();
    };

    tbb::task_arena arena(n_threads);
    arena.execute([&] {
      tbb::parallel_pipeline(slots.size(),
                             tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order, number) &
                                 tbb::make_filter<std::size_t, std::size_t>(tbb::filter_mode::parallel, evaluate) &
                                 tbb::make_filter<std::size_t, void>(tbb::filter_mode::serial_in_order, accumulate));
    });
    return std::move(*result);
  }
};

static_assert(Executor<TbbExecutor>);

}  // namespace liestat
