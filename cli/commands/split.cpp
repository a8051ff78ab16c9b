#include <cli/commands/split.hpp>

#include <experiments/feature.hpp>
#include <experiments/interruption.hpp>
#include <experiments/parallel.hpp>

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
      return program.reduce(
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
HalfMean describeHalf(const SplitPart<M>& part) {
  HalfMean half{.n = part.n, .mean = describe(part.result.estimate.mean)};
  if (part.result.valid) half.covariance = part.result.estimate.covariance;
  return half;
}

template <class M>
SplitValidation<M> validate(const Measurements& measurements, const SplitSettings& settings) {
  const SplitExecutor executor{{settings.threads}};
  const FeatureFile& file = measurements.file;
  if (measurements.criterion == Criterion::maha) {
    MahaOptions<M> how;
    how.likelihood = measurements.likelihood;
    return validateMahaBySplitting(executor, gaussiansOf<M>(file), measurements.covariance_at, how, file.times,
                                   settings.split);
  }
  if constexpr (Metric<M>) {
    std::vector<SquareOf<M>> noise;
    if (measurements.known_noise) noise = covariancesOf<M>(file);
    return validateMeanBySplitting(executor, featuresOf<M>(file), measurements.weights, noise, file.times,
                                   settings.split);
  } else {
    return validateGroupMeanBySplitting(executor, featuresOf<M>(file), measurements.weights, file.times,
                                        settings.split);
  }
}

/// The degrees of freedom of a series that an interrupt cut short: those of the splits that were done. No split begins any
/// more, so that this takes a few estimates.
template <class M>
void correctFreedom(const Measurements& measurements, const SplitSettings& settings,
                    SplitSeries SplitValidation<M>::*kind, SplitValidation<M>& validation) {
  SplitSeries& series = validation.*kind;
  SplitSettings done = settings;
  done.split.splits = series.distances.size();
  if (done.split.splits == 0 || done.split.splits == settings.split.splits) return;
  series.effective_dof = (validate<M>(measurements, done).*kind).effective_dof;
}

template <class M>
SplitResult split(const Measurements& measurements, const SplitSettings& settings) {
  SplitValidation<M> validation = validate<M>(measurements, settings);
  experiments::countTrials(validation.random.distances.size() + validation.by_blocks.distances.size());
  if (experiments::runStopped()) {
    correctFreedom(measurements, settings, &SplitValidation<M>::random, validation);
    correctFreedom(measurements, settings, &SplitValidation<M>::by_blocks, validation);
  }
  SplitResult result;
  result.n = validation.n;
  result.random = validation.random;
  result.by_blocks = validation.by_blocks;
  result.first = describeHalf(validation.first);
  result.second = describeHalf(validation.second);
  result.merged = describeHalf(validation.merged);
  result.squared_distance = validation.squared_distance;
  result.p_value = validation.p_value;
  result.law = validation.law.name();
  return result;
}

}  // namespace

std::size_t fewestMeasurements(const Measurements& measurements, const SplitOptions& options) {
  return fewestMeasurements(degreesOfFreedom(measurements.feature), measurements.known_noise, options);
}

SplitResult splitMeasurements(const Measurements& measurements, const SplitSettings& settings,
                              const std::function<void()>& advance) {
  SplitSettings how = settings;
  how.split.advance = advance;
  return experiments::withFeature(measurements.feature, [&]<class M>() { return split<M>(measurements, how); });
}

}  // namespace liestat::cli
