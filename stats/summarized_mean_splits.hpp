// splitMean: the validation of a mean's covariance by splits (stats/split_validation.hpp) for measurements as
// summarizedMean() takes them, as a result that is the same for all types. (Needs Boost.Math and Random123.)
#pragma once

#include <stats/split_validation.hpp>
#include <stats/split_validation_types.hpp>
#include <stats/summarized_mean.hpp>

#include <vector>

namespace liestat {

namespace detail {

template <Homogeneous M>
SplitHalf splitHalf(const SplitPart<M>& part) {
  SplitHalf half{.n = part.n, .parts = tangentPartsOf<M>(), .mean = featureValue(part.result.estimate.mean)};
  if (part.result.valid) half.covariance = part.result.estimate.covariance.template cast<double>();
  return half;
}

template <Homogeneous M, Executor E>
SplitValidation<M> validatedBySplitting(const E& executor, const MeanInput<M>& input, const std::vector<double>& times,
                                        const SplitOptions& options) {
  if (input.criterion == Criterion::maha) {
    MahaOptions<M> how;
    how.likelihood = input.likelihood;
    return validateMahaBySplitting(executor, input.gaussians(), input.covariance_at, how, times, options);
  }
  const std::vector<M> features(input.features.begin(), input.features.end());
  std::vector<double> weights(input.weights.begin(), input.weights.end());
  if (weights.empty()) weights.assign(features.size(), 1.0);
  if constexpr (Metric<M>) {
    std::vector<SquareOf<M>> noise = input.covariances;
    if (noise.size() == 1) noise.resize(features.size(), noise.front());
    return validateMeanBySplitting(executor, features, weights, noise, times, options);
  } else {
    return validateGroupMeanBySplitting(executor, features, weights, times, options);
  }
}

}  // namespace detail

/// All splits of measurements of which there are enough (fewestMeasurements). `times`: of each measurement; empty: they
/// are in order. The result has the same bits on any executor; `feature` is left to the caller.
template <Homogeneous M, Executor E>
SplitSummary splitMean(const E& executor, const MeanInput<M>& input, const std::vector<double>& times = {},
                       const SplitOptions& options = {}) {
  const SplitValidation<M> validation = detail::validatedBySplitting(executor, input, times, options);
  SplitSummary result;
  result.dof = ManifoldTraits<M>::DoF;
  result.known_noise = !input.covariances.empty();
  result.settings = options;
  result.random = validation.random;
  result.by_blocks = validation.by_blocks;
  result.n = validation.n;
  result.parts = tangentPartsOf<M>();
  result.group = !Metric<M>;
  result.criterion = input.criterion;
  if (result.known_noise && covarianceFrameMatters<M>()) result.covariance_at = input.covariance_at;
  result.first = detail::splitHalf(validation.first);
  result.second = detail::splitHalf(validation.second);
  result.merged = detail::splitHalf(validation.merged);
  result.squared_distance = validation.squared_distance;
  result.p_value = validation.p_value;
  result.law = validation.law.name();
  return result;
}

}  // namespace liestat
