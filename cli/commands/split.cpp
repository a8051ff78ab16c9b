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
SplitValidation<M> validate(const Measures& measures, const SplitSettings& settings) {
  const experiments::ProgramExecutor executor{settings.threads};
  const FeatureFile& file = measures.file;
  if (measures.criterion == Criterion::maha) {
    MahaOptions<M> how;
    how.likelihood = measures.likelihood;
    return validateMahaBySplitting(executor, gaussiansOf<M>(file), measures.covariance_at, how, file.times,
                                   settings.split);
  }
  if constexpr (Metric<M>) {
    std::vector<SquareOf<M>> noise;
    if (measures.known_noise) noise = covariancesOf<M>(file);
    return validateMeanBySplitting(executor, featuresOf<M>(file), measures.weights, noise, file.times, settings.split);
  } else {
    return validateGroupMeanBySplitting(executor, featuresOf<M>(file), measures.weights, file.times, settings.split);
  }
}

template <class M>
SplitResult split(const Measures& measures, const SplitSettings& settings) {
  const SplitValidation<M> validation = validate<M>(measures, settings);
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

std::size_t fewestMeasures(const Measures& measures, const SplitOptions& options) {
  return fewestMeasurements(degreesOfFreedom(measures.feature), measures.known_noise, options);
}

SplitResult splitMeasures(const Measures& measures, const SplitSettings& settings,
                          const std::function<void()>& advance) {
  SplitSettings how = settings;
  how.split.advance = advance;
  return experiments::withFeature(measures.feature, [&]<class M>() { return split<M>(measures, how); });
}

}  // namespace liestat::cli
