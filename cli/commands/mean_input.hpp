#pragma once

#include <cli/commands/measurements.hpp>
#include <stats/summarized_mean.hpp>

#include <vector>

namespace liestat::cli {

/// The measurements of a file for summarizedMean(). `features` are its rows, and must outlive the result, as the
/// measurements must.
template <class M>
MeanInput<M> meanInput(const Measurements& measurements, const std::vector<M>& features) {
  MeanInput<M> input{.criterion = measurements.criterion,
                     .features = features,
                     .covariance_at = measurements.covariance_at,
                     .likelihood = measurements.likelihood};
  if (measurements.usesWeights()) input.weights = measurements.weights;
  if (measurements.known_noise) {
    input.covariances.assign(measurements.file.covariances.begin(), measurements.file.covariances.end());
    input.factors.assign(measurements.file.factors.begin(), measurements.file.factors.end());
  }
  return input;
}

}  // namespace liestat::cli
