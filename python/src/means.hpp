// Means of any type through one interface of plain numbers, so that the binding compiles none of the estimators.
#pragma once

#include <python/src/executor.hpp>
#include <lie/point_group.hpp>
#include <stats/mean_summary.hpp>

#include <cstddef>
#include <span>
#include <string_view>

namespace liestat {
struct SplitOptions;
struct SplitSummary;
}  // namespace liestat

namespace liestat::python {

/// Arguments of the means and of their validation by splits.
struct MeanRequest {
  Criterion criterion = Criterion::lsq;
  std::span<const double> features;     ///< rows of parameters
  std::span<const double> weights;      ///< one for each feature, or empty
  std::span<const double> covariances;  ///< dof×dof matrices, one for each feature or a single one, or empty
  bool factored = false;                ///< these matrices are factors of the covariances
  std::span<const double> times;        ///< one for each feature, or empty
  CovarianceAt covariance_at = CovarianceAt::measured;
  bool likelihood = false;
  RefutedNoise refuted_noise = RefutedNoise::withheld;
  bool birge = false;  ///< multiply by Birge's factor
  ResidualNoise weights_are = ResidualNoise::precision;
  MeanRegion region = MeanRegion::law;
  bool inflate = false;  ///< by the dependence of errors on the times
  bool certify = true;
  PointGroup symmetry = {};  ///< of orientations of crystals
  std::size_t budget = 0;    ///< limit of the search; 0: the library's
  int threads = 0;
};

/// summarizedMean() of a type.
using MeanFunction = MeanSummary (*)(const MeanRequest&, SignalWatch&);
/// splitMean() of a type.
using SplitFunction = SplitSummary (*)(const MeanRequest&, SignalWatch&, const SplitOptions&);
/// testedFuse() of features with covariances: writes the mean's parameters, its covariance and the factor of that (of
/// factors only).
struct TestedFuse {
  Status status = Status::too_few;
  NoiseFit fit;
};
using FuseFunction = TestedFuse (*)(const MeanRequest&, double* mean, double* covariance, double* factor);

/// A type whose means are compiled in.
struct MeanType {
  std::string_view name;
  std::string_view feature;  ///< its name in results, which is that of the program
  int parameters = 0, dof = 0;
  MeanFunction mean = nullptr;
  SplitFunction split = nullptr;
  FuseFunction fuse = nullptr;
};

/// The types' means by name, one function for each translation unit that holds some; nothing for other names.
const MeanType* commonMeans(std::string_view name);
const MeanType* planarMeans(std::string_view name);
const MeanType* extendedPoseMeans(std::string_view name);
/// Orientations of crystals have means alone.
const MeanType* crystalMeans(std::string_view name);
/// The splits of the common means, which are compiled apart.
template <class M>
SplitSummary splitOf(const MeanRequest& request, SignalWatch& signals, const SplitOptions& options);

}  // namespace liestat::python
