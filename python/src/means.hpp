// Means of any type through one interface of plain numbers, so that the binding compiles none of the estimators.
#pragma once

#include <python/src/executor.hpp>

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace liestat::python {

/// Arguments of the means.
struct MeanRequest {
  std::span<const double> features;     ///< rows of parameters
  std::span<const double> weights;      ///< one for each feature, or empty
  std::span<const double> covariances;  ///< dof×dof matrices, one for each feature or a single one, or empty
  bool covariances_at_measurement = true;
  bool likelihood = false;
  bool certify = true;
  std::size_t budget = 0;  ///< of the search; 0: the library's
  int threads = 0;
};

/// A mean with all that is known about it. Matrices are row-major, empty where there are none.
struct MeanAnswer {
  std::size_t n = 0;
  std::vector<double> mean, covariance, dispersion, rivals, near_ties, near_tie_z;
  std::string_view status, reason, uniqueness, proof;
  bool converged = false, more_rivals = false, concentrated = true;
  int iterations = 0;
  double residual = 0, tolerance = 0, cost = 0, r_star = 0, hessian_change = 0, fit = 0, fit_dof = 0;
  std::size_t cells = 0;
  int law_samples = 0;  ///< of Hotelling's law; 0: the covariance is of known noise, and the law is χ²
};

using MeanFunction = MeanAnswer (*)(const MeanRequest&, SignalWatch&);

/// fuse() of features with covariances: writes the mean's parameters and its covariance, NaN where it is not to be
/// trusted.
using FuseFunction = void (*)(const MeanRequest&, double* mean, double* covariance);

/// A type whose means are compiled in, and the criteria that it has.
struct MeanType {
  std::string_view name;
  MeanFunction least_squares = nullptr, mahalanobis = nullptr, barycentre = nullptr;
  FuseFunction fuse = nullptr;
};

/// The types' means by name, one function for each translation unit that holds some; nothing for other names.
const MeanType* commonMeans(std::string_view name);
const MeanType* planarMeans(std::string_view name);
const MeanType* extendedPoseMeans(std::string_view name);

}  // namespace liestat::python
