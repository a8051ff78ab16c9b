// Long calls of estimators that know no executor: they run on a thread of their own while the calling one looks for
// Python's signals.
#pragma once

#include <python/src/executor.hpp>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <type_traits>
#include <utility>

namespace liestat::python {

/// Thrown by work that was asked to stop.
struct Stopped {};

/// Runs work(stop), which owns all that it uses, without the GIL, and returns its result. If a signal's handler raises,
/// `stop` becomes true and that exception leaves at once: the work ends by itself, at the latest when it is done, and
/// its result is dropped.
template <class Work>
auto interruptible(Work work) {
  using Result = std::invoke_result_t<Work&, const std::atomic<bool>&>;
  struct Shared {
    explicit Shared(Work&& w) : work(std::move(w)) {}
    Work work;
    std::atomic<bool> stop = false;
    std::mutex mutex;
    std::condition_variable changed;
    bool done = false;
    std::optional<Result> result;
    std::exception_ptr error;
  };
  const auto shared = std::make_shared<Shared>(std::move(work));
  std::thread thread([shared] {
    std::optional<Result> result;
    std::exception_ptr error;
    try {
      result.emplace(shared->work(shared->stop));
    } catch (...) {
      error = std::current_exception();
    }
    const std::lock_guard lock(shared->mutex);
    shared->result = std::move(result);
    shared->error = error;
    shared->done = true;
    shared->changed.notify_one();
  });
  std::unique_lock lock(shared->mutex);
  while (!shared->changed.wait_for(lock, std::chrono::milliseconds(50), [&] { return shared->done; })) {
    lock.unlock();
    try {
      raisePendingSignal();
    } catch (...) {
      shared->stop = true;
      thread.detach();
      throw;
    }
    lock.lock();
  }
  lock.unlock();
  thread.join();
  if (shared->error) std::rethrow_exception(shared->error);
  return std::move(*shared->result);
}

}  // namespace liestat::python
