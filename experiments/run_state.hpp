// The results of a run's tasks in a file, so that a run is shared by machines, and goes on after it was killed.
//
// A task is the trials of one chunk of an executor's reduction; tasks are the same for any number of threads, and their
// results are combined in order wherever they come from: a run from files has the bits of a run in one go.
#pragma once

#include <experiments/interruption.hpp>
#include <experiments/parallel.hpp>
#include <stats/chunk_codec.hpp>

#include <chrono>
#include <cstddef>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat::experiments {

/// A part of a run: the tasks number - 1, number - 1 + count, … of all tasks of all experiments.
struct RunPart {
  std::size_t number = 1, count = 1;
  bool whole() const { return count == 1; }
};

/// The tasks of the process that have a result, in memory and in a file. Functions may be called from any thread.
class RunState {
 public:
  using Bytes = ChunkBytes;

  /// Takes results over from all parts of a run, which `run` names: the command and the options that decide its numbers.
  /// Throws InputError for files that are damaged, of another run or version, or not all of its parts.
  void merge(const std::string& run, const std::vector<std::string>& files);
  /// Keeps the results of a part in a file, and takes over those that are there already. Throws InputError if the file
  /// cannot be written, or holds something else.
  void keep(const std::string& run, const std::string& file, const RunPart& part);

  bool active() const { return !run_.empty(); }
  /// True if other parts have the rest of the results: there is nothing to show of this one.
  bool isPart() const { return !file_.empty() && !part_.whole(); }

  /// The next experiment has so many tasks; its number, and those tasks that are of this part. Experiments come in the
  /// same order in each run.
  std::pair<std::size_t, std::vector<std::size_t>> begin(std::size_t tasks);
  /// The result of a task: what is there, or evaluate(), which is kept unless an interrupt has come.
  Bytes result(std::size_t experiment, std::size_t task, const std::function<Bytes()>& evaluate);

  /// Writes the file once more, at the end of a run.
  void finish();
  std::size_t tasks() const { return tasks_; }  ///< of all experiments that have begun
  std::size_t done() const { return done_; }    ///< those with a result
  std::size_t taken_over() const { return taken_over_; }
  const std::string& file() const { return file_; }
  const RunPart& part() const { return part_; }

 private:
  struct Experiment {
    std::size_t tasks = 0;
    std::map<std::size_t, Bytes> results;
  };
  struct File {
    RunPart part;
    bool complete = false;
    std::vector<Experiment> experiments;
  };
  File read(const std::string& path) const;
  void write(bool complete);

  std::mutex mutex_;
  std::string run_, file_;
  RunPart part_;
  std::vector<Experiment> experiments_;
  std::size_t begun_ = 0, tasks_ = 0, done_ = 0, taken_over_ = 0;
  std::chrono::steady_clock::time_point written_;
  std::chrono::duration<double> pause_{1};  ///< between two times that the file is written
};
/// The state of the process, which runs one command.
inline RunState run_state;

/// ProgramExecutor for trials: what has a result in run_state is not evaluated again, and of a part of a run nothing is
/// returned (T{}).
struct TrialExecutor {
  int threads = 0;

  template <class Map, class Combine>
  auto reduce(std::size_t n_chunks, Map&& map, Combine&& combine) const {
    using T = std::remove_cvref_t<std::invoke_result_t<Map&, std::size_t>>;
    using Codec = ChunkCodec<T>;
    static_assert(Codec::supported, "the results of trials are kept as bytes");
    const ProgramExecutor program{threads};
    if (!run_state.active()) return T(program.reduce(n_chunks, map, combine));
    const auto [experiment, mine] = run_state.begin(n_chunks);
    const auto result = [&, experiment = experiment](std::size_t task) {
      return run_state.result(experiment, task, [&] { return Codec::encode(std::invoke(map, task)); });
    };
    if (!run_state.isPart()) {
      return T(program.reduce(
          n_chunks, [&](std::size_t task) { return Codec::decode(result(task)); }, combine));
    }
    program.reduce(
        mine.size(), [&, &mine = mine](std::size_t k) { return result(mine[k]).size(); },
        [](std::size_t, std::size_t more) { return more; });
    return T{};
  }
};
static_assert(Executor<TrialExecutor>);

}  // namespace liestat::experiments
