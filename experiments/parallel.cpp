#include <experiments/parallel.hpp>

#ifdef LIESTAT_HAS_TBB
#include <stats/compat/tbb.hpp>

#include <tbb/info.h>
#endif

namespace liestat::experiments {

#ifdef LIESTAT_HAS_TBB

std::size_t mostUnderWay(int threads) {
  const int n_threads = threads > 0 ? threads : tbb::info::default_concurrency();
  // TbbExecutor's, and the chunk before, which is finished together with the next one.
  return 4 * static_cast<std::size_t>(n_threads) + 1;
}

void runInOrder(int threads, std::size_t n_chunks, const std::function<void(std::size_t)>& evaluate,
                const std::function<void(std::size_t)>& finish) {
  if (n_chunks == 0) return;
  TbbExecutor{threads}.reduce(
      n_chunks,
      [&](std::size_t chunk) {
        evaluate(chunk);
        return chunk;
      },
      // Called with (0, 1), (1, 2), …
      [&](std::size_t& last, const std::size_t& chunk) {
        finish(last);
        last = chunk;
      });
  finish(n_chunks - 1);
}

#else

std::size_t mostUnderWay(int /*threads*/) { return 1; }

void runInOrder(int /*threads*/, std::size_t n_chunks, const std::function<void(std::size_t)>& evaluate,
                const std::function<void(std::size_t)>& finish) {
  for (std::size_t chunk = 0; chunk < n_chunks; ++chunk) {
    evaluate(chunk);
    finish(chunk);
  }
}

#endif

}  // namespace liestat::experiments
