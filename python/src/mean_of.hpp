// The means behind means.hpp, for one type.
#pragma once

#include <python/src/array_operations.hpp>
#include <python/src/means.hpp>
#include <stats/summarized_mean.hpp>

#include <cstdint>
#include <span>
#include <vector>

namespace liestat::python {

/// Rows of parameters as features: in place where the memory is aligned for them, else copied.
template <class M>
class Features {
 public:
  explicit Features(std::span<const double> numbers) {
    constexpr std::size_t p = parametersOf<M>();
    static_assert(sizeof(M) == p * sizeof(double));
    const std::size_t n = numbers.size() / p;
    if (reinterpret_cast<std::uintptr_t>(numbers.data()) % alignof(M) == 0) {
      list_ = {reinterpret_cast<const M*>(numbers.data()), n};
      return;
    }
    copy_.reserve(n);
    for (std::size_t i = 0; i < n; ++i) copy_.push_back(point<M>(numbers.data() + i * p));
    list_ = copy_;
  }
  std::span<const M> list() const { return list_; }

 private:
  std::vector<M> copy_;
  std::span<const M> list_;
};

/// The request as the library takes it; features and request must outlive it.
template <class M>
MeanInput<M> inputOf(const MeanRequest& request, std::span<const M> features) {
  constexpr std::size_t k = ManifoldTraits<M>::DoF;
  MeanInput<M> input{.criterion = request.criterion,
                     .features = features,
                     .weights = request.weights,
                     .covariance_at = request.covariance_at,
                     .likelihood = request.likelihood,
                     .refuted_noise = request.refuted_noise,
                     .weights_are = request.weights_are,
                     .scale_noise = request.birge,
                     .region = request.region,
                     .times = request.times,
                     .inflate = request.inflate};
  for (std::size_t i = 0; i + k * k <= request.covariances.size(); i += k * k) {
    const auto matrix = square<ManifoldTraits<M>::DoF>(request.covariances.data() + i);
    if (request.factored) input.factors.push_back(matrix);
    input.covariances.push_back(
        request.factored ? FactoredGaussian<M>{ManifoldTraits<M>::origin(), matrix}.gaussian().covariance : matrix);
  }
  return input;
}

template <class M>
MeanSummary meanOfFeatures(const MeanRequest& request, std::span<const M> features, SignalWatch& signals) {
  MeanSummaryOptions how;
  how.certificates = request.certify;
  if (request.budget > 0) how.uniqueness.budget = request.budget;
  how.uniqueness.progress = [&signals](double) { signals.look(); };
  return summarizedMean(PythonExecutor{request.threads, &signals}, inputOf(request, features), how);
}
template <class M>
MeanSummary meanOf(const MeanRequest& request, SignalWatch& signals) {
  return meanOfFeatures(request, Features<M>(request.features).list(), signals);
}

template <class M>
TestedFuse fuseFeatures(const MeanRequest& request, double* mean, double* covariance, double* factor) {
  const Features<M> features(request.features);
  const MeanInput<M> input = inputOf(request, features.list());
  const FuseResult<M> result = request.factored ? testedFuse(input.factoredGaussians(), request.covariance_at)
                                                : testedFuse(input.gaussians(), request.covariance_at);
  if (request.factored) store(result.factor, factor);
  storePoint(result.estimate.mean, mean);
  store(result.estimate.covariance, covariance);
  return {result.status, result.fit};
}

template <class M>
constexpr MeanType meanType(std::string_view name, std::string_view feature) {
  return {name, feature, parametersOf<M>(), ManifoldTraits<M>::DoF, meanOf<M>, splitOf<M>, fuseFeatures<M>};
}

}  // namespace liestat::python
