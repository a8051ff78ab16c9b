// One experiment among the several of a run.
#pragma once

#include <experiments/interruption.hpp>
#include <stats/validation.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>

namespace liestat::experiments {

/// How much of the work of a run was done before the experiment, what the experiment takes, and what the run takes, in any
/// unit.
struct PartOfRun {
  double before, work, all;
};

/// The options of the trials of an experiment: an interrupt stops them, and progress, where given, is told in millionths of
/// the run. `validation` has the fields trials and seed.
template <class Validation>
ValidationOptions trialsOf(const Validation& validation, std::size_t chunk_size, const PartOfRun& part,
                           const std::function<void(std::uint64_t done, std::uint64_t all)>& progress) {
  ValidationOptions options{
      .trials = validation.trials, .seed = validation.seed, .chunk_size = chunk_size, .stop = runStopped};
  if (progress) {
    options.progress = [part, progress](std::size_t done, std::size_t of) {
      const double share = static_cast<double>(done) / static_cast<double>(of);
      progress(static_cast<std::uint64_t>(1e6 * (part.before + share * part.work) / part.all), 1000000);
    };
  }
  return options;
}

}  // namespace liestat::experiments
