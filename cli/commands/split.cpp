#include <cli/commands/split.hpp>

#include <experiments/feature.hpp>
#include <experiments/parallel.hpp>

#include <vector>

namespace liestat::cli {
namespace {

template <class M>
HalfMean describeHalf(const SplitPart<M>& part) {
  HalfMean half{.n = part.n, .mean = describe(part.result.estimate.mean)};
  if (part.result.valid) half.covariance = part.result.estimate.covariance;
  return half;
}

template <class M>
SplitValidation<M> validate(const Measurements& measurements, const SplitSettings& settings) {
  const experiments::ProgramExecutor executor{settings.threads};
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

template <class M>
SplitResult split(const Measurements& measurements, const SplitSettings& settings) {
  const SplitValidation<M> validation = validate<M>(measurements, settings);
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
