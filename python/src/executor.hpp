// The executor of a call: threads if oneTBB is there, and Python's signals are looked for all the while.
#pragma once

#include <stats/executor.hpp>
#ifdef LIESTAT_WITH_TBB
#include <stats/compat/tbb.hpp>
#endif

#include <chrono>
#include <cstddef>
#include <functional>
#include <stdexcept>
#include <thread>
#include <utility>

namespace liestat::python {

/// Raises what a signal's handler raised (KeyboardInterrupt), if a signal is pending. Takes the GIL. Defined by the
/// binding.
void raisePendingSignal();

/// Looks for signals now and then, at most twenty times a second, on the thread that made it: on any other thread Python
/// handles none. Throws what the handler raised.
class SignalWatch {
 public:
  void look() {
    if (std::this_thread::get_id() != owner_) return;
    const auto now = std::chrono::steady_clock::now();
    if (now - last_ < std::chrono::milliseconds(50)) return;
    last_ = now;
    raisePendingSignal();
  }

 private:
  std::thread::id owner_ = std::this_thread::get_id();
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

/// An Executor: `threads` threads, 0 for as many as the machine has; without oneTBB the calling one alone. Same bits for
/// any number.
struct PythonExecutor {
  int threads = 0;
  SignalWatch* signals = nullptr;

  template <class Map, class Combine>
  auto reduce(std::size_t n_chunks, Map&& map, Combine&& combine) const {
    const auto watched = [&](std::size_t chunk) {
      if (signals != nullptr) signals->look();
      return std::invoke(map, chunk);
    };
#ifdef LIESTAT_WITH_TBB
    if (threads != 1 && n_chunks > 1) return TbbExecutor{threads}.reduce(n_chunks, watched, combine);
#endif
    return SerialExecutor{}.reduce(n_chunks, watched, combine);
  }
};

static_assert(Executor<PythonExecutor>);

}  // namespace liestat::python
