// The rows of a file as a type of feature.
#pragma once

#include <formats/measurements.hpp>
#include <formats/feature.hpp>
#include <stats/summarized_mean.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <type_traits>
#include <vector>

namespace liestat {

/// The rows of a file as features of type M, whose parameters are its parts one after the other.
template <class M>
std::vector<M> featuresOf(const FeatureFile& file) {
  std::vector<M> list;
  list.reserve(file.size());
  for (std::size_t i = 0; i < file.size(); ++i) {
    Eigen::Matrix<double, 7, 1> params;
    Eigen::Index n = 0;
    for (const FeaturePart part : info<M>().parts) {
      switch (part) {
        case FeaturePart::rotation:
          params.segment<4>(n) = file.rotations[i].coeffs(), n += 4;
          break;
        case FeaturePart::position:
          params.segment<3>(n) = file.positions[i], n += 3;
          break;
        case FeaturePart::direction:
          params.segment<3>(n) = file.directions[i], n += 3;
          break;
      }
    }
    if constexpr (std::is_same_v<M, Eigen::Vector3d>) {
      list.push_back(params.head<3>());
    } else {
      list.push_back(M::fromParams(typename M::Params(params.head<M::num_parameters>())));
    }
  }
  return list;
}

/// The same with their covariances.
template <class M>
std::vector<Gaussian<M>> gaussiansOf(const FeatureFile& file) {
  const std::vector<M> features = featuresOf<M>(file);
  std::vector<Gaussian<M>> list;
  list.reserve(features.size());
  for (std::size_t i = 0; i < features.size(); ++i) list.push_back({features[i], file.covariances[i]});
  return list;
}

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
  }
  return input;
}

}  // namespace liestat
