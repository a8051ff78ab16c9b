// The trials of a validation, cell after cell: the one place where they are counted, interrupted, spread over threads
// and told to a progress bar.
#pragma once

#include <experiments/interruption.hpp>
#include <experiments/run_state.hpp>
#include <stats/validation.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::experiments {

/// Told now and then that so much of all work is done, in any unit; from any thread, never twice at the same time.
using RunProgress = std::function<void(std::uint64_t done, std::uint64_t all)>;

/// The size of a run. Trial number i draws the same numbers whatever the number of trials and of threads.
struct RunSize {
  std::size_t trials = 0;  ///< each cell's number
  std::uint64_t seed = 1;
  int threads = 0;  ///< 0: as many as the machine has
};

/// The trials of one cell, and what they cost together, in any unit.
struct CellSize {
  std::size_t trials;
  double cost;
};

/// Runs the cells of a validation in their order. A cell that is interrupted has the first of its trials.
class CellRun {
 public:
  CellRun(const RunSize& size, std::vector<CellSize> cells, RunProgress progress)
      : size_(size), cells_(std::move(cells)), progress_(std::move(progress)) {
    for (const CellSize& cell : cells_) all_ += cell.cost, trials_of_run.planned += cell.trials;
  }

  /// The next cell by validateAll() of stats/validation.hpp: a report for each law. A trial may only return its results,
  /// which may come from a file (experiments/run_state.hpp).
  template <class Trial>
  auto reports(std::size_t chunk_size, const std::vector<ReferenceLaw>& laws, Trial&& trial) {
    const std::size_t trials = cells_[next_].trials;
    auto list = validateAll(TrialExecutor{size_.threads},
                            {.trials = trials,
                             .seed = size_.seed,
                             .chunk_size = chunk_size,
                             .progress = [&](std::size_t done, std::size_t) { tell(done); },
                             .stop = runStopped},
                            laws, std::forward<Trial>(trial));
    finish(list.empty() ? trials : list[0].trials);
    return list;
  }

  /// The next cell as a list of trial(number), plain data. `whole`: if not all of them were done, none is given.
  template <class Trial>
  auto outcomes(Trial&& trial, bool whole = false) {
    using Outcomes = std::vector<std::invoke_result_t<Trial&, std::uint64_t>>;
    const std::size_t trials = cells_[next_].trials;
    // One trial in a chunk: some cells have ten of a second each.
    Outcomes list = TrialExecutor{size_.threads}.reduce(
        trials, [&](std::size_t i) { return runStopped() ? Outcomes{} : Outcomes{trial(std::uint64_t{i})}; },
        [&](Outcomes& done, const Outcomes& more) {
          done.insert(done.end(), more.begin(), more.end());
          tell(done.size());
        });
    if (whole && list.size() < trials) list.clear();
    finish(list.size());
    return list;
  }

  /// The last cell was interrupted before its first trial ended, or its trials are part of a run: there is nothing to
  /// show of it. Further cells of an interrupted run have no trials either.
  bool ended() const { return ended_; }

 private:
  void tell(std::size_t done) const {
    if (!progress_) return;
    const CellSize& cell = cells_[next_];
    const double share = static_cast<double>(done) / static_cast<double>(cell.trials);
    progress_(static_cast<std::uint64_t>(1e6 * (before_ + share * cell.cost) / all_), 1000000);
  }
  void finish(std::size_t done) {
    tell(done);
    ended_ = !countTrials(done);
    before_ += cells_[next_++].cost;
  }

  RunSize size_;
  std::vector<CellSize> cells_;
  RunProgress progress_;
  std::size_t next_ = 0;
  double all_ = 0, before_ = 0;
  bool ended_ = false;
};

}  // namespace liestat::experiments
