#include <cli/commands/split.hpp>

#include <cli/commands/mean_input.hpp>
#include <experiments/interruption.hpp>
#include <experiments/run_state.hpp>
#include <stats/summarized_mean_splits.hpp>

#include <concepts>
#include <cstddef>
#include <functional>
#include <type_traits>
#include <vector>

namespace liestat::cli {
namespace {

/// The program's executor for series of splits. Once an interrupt has come no split begins, and of each series the first
/// splits are left, those before the first one that did not begin.
struct SplitExecutor {
  experiments::ProgramExecutor program;

  template <class Map, class Combine>
  auto reduce(std::size_t n_chunks, const Map& map, const Combine& combine) const {
    using Distances = std::vector<double>;
    if constexpr (!std::same_as<std::invoke_result_t<const Map&, std::size_t>, Distances>) {
      return program.reduce(n_chunks, map, combine);
    } else {
      bool cut = false;
      return experiments::TrialExecutor{program.threads}.reduce(
          n_chunks, [&](std::size_t split) { return experiments::runStopped() ? Distances{} : map(split); },
          [&](Distances& all, const Distances& more) {
            // A split that began a little before the interrupt may come after one that did not.
            cut = cut || all.empty() || more.empty();
            if (!cut) combine(all, more);
          });
    }
  }
};

template <class M>
SplitSummary split(const Measurements& measurements, const SplitSettings& settings) {
  const SplitExecutor executor{{settings.threads}};
  const std::vector<M> features = featuresOf<M>(measurements.file);
  const auto with = [&](const SplitOptions& options) {
    return splitMean(executor, meanInput(measurements, features), measurements.file.times, options);
  };
  SplitSummary result = with(settings.split);
  result.feature = name(measurements.feature);
  experiments::countTrials(result.done());
  if (!experiments::runStopped()) return result;
  // The degrees of freedom of a series that an interrupt cut short are those of the splits that were done. No split begins
  // any more, so that this takes a few estimates.
  for (SplitSeries SplitOutcome::*const kind : {&SplitOutcome::random, &SplitOutcome::by_blocks}) {
    SplitSeries& series = result.*kind;
    SplitOptions done = settings.split;
    done.splits = series.distances.size();
    if (done.splits == 0 || done.splits == settings.split.splits) continue;
    series.effective_dof = (with(done).*kind).effective_dof;
  }
  return result;
}

}  // namespace

std::size_t fewestMeasurements(const Measurements& measurements, const SplitOptions& options) {
  return fewestMeasurements(degreesOfFreedom(measurements.feature), measurements.known_noise, options);
}

SplitSummary splitMeasurements(const Measurements& measurements, const SplitSettings& settings,
                               const std::function<void()>& advance) {
  SplitSettings how = settings;
  how.split.advance = advance;
  return withFeature(measurements.feature, [&]<class M>() { return split<M>(measurements, how); });
}

}  // namespace liestat::cli
