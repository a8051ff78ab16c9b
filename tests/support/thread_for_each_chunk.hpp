// An executor without TBB: tests of kernels that must give the same bits on threads.
#pragma once

#include <stats/executor.hpp>

#include <cstddef>
#include <future>
#include <vector>

namespace liestat::test {

/// Every chunk on a thread of its own.
struct ThreadForEachChunk {
  template <class Map, class Combine>
  detail::ChunkResult<Map> reduce(std::size_t n_chunks, Map&& map, Combine&& combine) const {
    std::vector<std::future<detail::ChunkResult<Map>>> results;
    for (std::size_t c = 0; c < n_chunks; ++c) {
      results.push_back(std::async(std::launch::async, [&map, c] { return map(c); }));
    }
    if (n_chunks == 0) return {};
    detail::ChunkResult<Map> sum = results[0].get();
    for (std::size_t c = 1; c < n_chunks; ++c) detail::combineInto(combine, sum, results[c].get());
    return sum;
  }
};
static_assert(Executor<ThreadForEachChunk>);

}  // namespace liestat::test
