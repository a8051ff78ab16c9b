// The interruption of a run of trials.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace liestat::experiments {

/// The trials of all experiments of the process, which runs one command and has one interrupt. Once `stop` is set, no
/// further trial and no further experiment begins, and the experiments return what they have computed.
struct TrialsOfRun {
  std::atomic<bool> stop{false};
  std::atomic<std::uint64_t> planned{0};
  std::atomic<std::uint64_t> done{0};

  /// An interrupt has left trials undone.
  bool incomplete() const { return stop && done < planned; }
};
inline TrialsOfRun trials_of_run;

/// The fields of a run that an interrupt left incomplete; else there are none.
template <class V>
void describe(V& v, const TrialsOfRun& run) {
  if (!run.incomplete()) return;
  v("interrupted", true)("trials_done", run.done.load())("trials_planned", run.planned.load());
}
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler sets it");

inline bool runStopped() { return trials_of_run.stop.load(std::memory_order_relaxed); }

/// Counts the trials of an experiment that has ended. False: it was stopped before its first trial ended, and there is
/// nothing to show of it.
inline bool countTrials(std::size_t done) {
  trials_of_run.done += done;
  return done > 0;
}

}  // namespace liestat::experiments
