#pragma once

#include <stats/executor.hpp>

#ifdef LIESTAT_HAS_TBB
#include <stats/compat/tbb.hpp>
#endif

namespace liestat::experiments {

/// The executor of the program: threads where it was built with oneTBB, else the calling thread.
struct ProgramExecutor {
  int threads = 0;  ///< 0: as many as the machine has

  template <class Map, class Combine>
  auto reduce(std::size_t n_chunks, Map&& map, Combine&& combine) const {
#ifdef LIESTAT_HAS_TBB
    return TbbExecutor{threads}.reduce(n_chunks, map, combine);
#else
    return SerialExecutor{}.reduce(n_chunks, map, combine);
#endif
  }
};

}  // namespace liestat::experiments
