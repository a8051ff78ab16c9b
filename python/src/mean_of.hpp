// The certified means behind means.hpp, for one type.
#pragma once

#include <python/src/array_operations.hpp>
#include <python/src/means.hpp>
#include <stats/certified_group_mean.hpp>
#include <stats/certified_maha.hpp>
#include <stats/certified_mean.hpp>
#include <stats/concentration.hpp>
#include <stats/covariance.hpp>
#include <stats/detail/any_executor.hpp>
#include <stats/dispersion.hpp>

#include <algorithm>
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

template <class M>
std::vector<SquareOf<M>> matrices(std::span<const double> numbers) {
  constexpr std::size_t kk = ManifoldTraits<M>::DoF * ManifoldTraits<M>::DoF;
  std::vector<SquareOf<M>> list;
  for (std::size_t i = 0; i + kk <= numbers.size(); i += kk) {
    list.push_back(square<ManifoldTraits<M>::DoF>(numbers.data() + i));
  }
  return list;
}

template <class M>
void append(std::vector<double>& list, const M& x) {
  double row[parametersOf<M>()];
  storePoint(x, row);
  list.insert(list.end(), std::begin(row), std::end(row));
}

inline UniquenessOptions uniquenessOptions(const MeanRequest& request, SignalWatch& signals, std::size_t most) {
  UniquenessOptions how;
  how.budget = request.budget > 0 ? request.budget : most;
  how.progress = [&signals](double) { signals.look(); };
  return how;
}

/// The fields of every certified estimate.
template <class M, class Iteration, class Certified>
void setEstimate(MeanAnswer& answer, const Iteration& iteration, const Certified& result) {
  answer.n = iteration.n;
  append(answer.mean, iteration.mean);
  answer.converged = converged(iteration.status);
  answer.iterations = iteration.iterations;
  answer.residual = iteration.residual;
  answer.tolerance = iteration.tolerance;
  answer.status = name(result.status);
  answer.reason = result.reason;
  answer.uniqueness = name(result.uniqueness.unique);
  answer.proof = result.uniqueness.proof;
  answer.r_star = result.uniqueness.r_star;
  answer.cells = result.uniqueness.cells;
  answer.more_rivals = result.uniqueness.more_rivals;
  answer.hessian_change = result.hessian_change;
  for (const M& rival : result.uniqueness.rivals) append(answer.rivals, rival);
  for (const auto& tie : result.near_ties) {
    append(answer.near_ties, tie.feature);
    answer.near_tie_z.push_back(tie.z);
  }
  if (result.estimate) {
    answer.covariance.resize(ManifoldTraits<M>::DoF * ManifoldTraits<M>::DoF);
    store(result.estimate->covariance, answer.covariance.data());
  }
}

template <class M>
void setDispersion(MeanAnswer& answer, const MeanRequest& request, std::span<const M> features, const M& mean) {
  if (answer.n == 0) return;
  answer.dispersion.resize(ManifoldTraits<M>::DoF * ManifoldTraits<M>::DoF);
  const auto dispersion = request.weights.empty() ? dispersionAbout(features, mean).covariance
                                                  : dispersionAbout(features, request.weights, mean).covariance;
  store(dispersion, answer.dispersion.data());
}

/// The fields of an uncertified estimate: the iteration, and its covariance where the features show a mean at all.
template <class M, class Iteration>
void setPlainEstimate(MeanAnswer& answer, const Iteration& iteration, const SquareOf<M>& covariance,
                      const Concentration& concentration) {
  answer.n = iteration.n;
  append(answer.mean, iteration.mean);
  answer.converged = converged(iteration.status);
  answer.iterations = iteration.iterations;
  answer.residual = iteration.residual;
  answer.tolerance = iteration.tolerance;
  answer.uniqueness = name(Uniqueness::not_certified);
  answer.concentrated = concentration.concentrated;
  const auto without = [&](Status status, std::string_view reason) {
    answer.status = name(status);
    answer.reason = reason;
  };
  if (iteration.n == 0) return without(Status::too_few, "there are no features");
  if (!converged(iteration.status)) return without(iteration.status, liestat::detail::not_converged_reason);
  const bool from_residuals = answer.law_samples > 0;
  if (from_residuals && iteration.n <= static_cast<std::size_t>(ManifoldTraits<M>::DoF)) {
    return without(Status::too_few, liestat::detail::too_few_reason);
  }
  if (!concentration.concentrated) return without(Status::ill_defined, liestat::detail::scattered_reason);
  if (!covariance.allFinite()) return without(Status::ill_defined, liestat::detail::hessian_reason);
  answer.status = name(Status::ok);
  answer.covariance.resize(ManifoldTraits<M>::DoF * ManifoldTraits<M>::DoF);
  store(covariance, answer.covariance.data());
}

/// The mean without a search for others and without the certificates.
template <Metric M>
MeanAnswer plainLeastSquares(const MeanRequest& request, SignalWatch& signals) {
  const Features<M> features(request.features);
  const PythonExecutor executor{request.threads, &signals};
  const liestat::detail::AnyExecutor any(executor);
  const auto ones = liestat::detail::ones(features.list().size());
  const auto samples = features.list();
  const MeanResult<M> result = request.weights.empty()
                                   ? liestat::detail::frechetMean<M>(any, liestat::detail::asSamples(samples), ones, {})
                                   : mean(any, samples, request.weights);
  MeanAnswer answer;
  const std::vector<SquareOf<M>> noise = matrices<M>(request.covariances);
  if (noise.empty()) answer.law_samples = static_cast<int>(result.n);
  SquareOf<M> covariance;
  if (noise.empty()) {
    covariance = covarianceFromResiduals(result);
  } else {
    covariance = request.weights.empty() ? covarianceFromNoise(result, noise)
                                         : covarianceFromNoise(result, request.weights, noise);
  }
  setPlainEstimate<M>(answer, result, covariance,
                      request.weights.empty() ? concentration(samples, result.mean)
                                              : concentration(samples, request.weights, result.mean));
  answer.cost = result.cost;
  if (result.n > 0) {
    answer.dispersion.resize(ManifoldTraits<M>::DoF * ManifoldTraits<M>::DoF);
    store(result.dispersion(), answer.dispersion.data());
  }
  return answer;
}

template <Metric M>
MeanAnswer leastSquares(const MeanRequest& request, SignalWatch& signals) {
  if (!request.certify) return plainLeastSquares<M>(request, signals);
  const Features<M> features(request.features);
  const PythonExecutor executor{request.threads, &signals};
  CertifiedMeanOptions<M> how;
  how.uniqueness = uniquenessOptions(request, signals, how.uniqueness.budget);
  how.known_noise = matrices<M>(request.covariances);
  const CertifiedMean<M> result = request.weights.empty()
                                      ? certifiedMean(executor, features.list(), how)
                                      : certifiedMean(executor, features.list(), request.weights, how);
  MeanAnswer answer;
  setEstimate<M>(answer, result.mean, result);
  answer.cost = result.mean.cost;
  answer.concentrated = result.concentration.concentrated;
  if (how.known_noise.empty()) answer.law_samples = static_cast<int>(result.mean.n);
  setDispersion<M>(answer, request, features.list(), result.mean.mean);
  return answer;
}

/// The features with their covariances, of which there may be a single one.
template <Homogeneous M>
std::vector<Gaussian<M>> gaussians(const MeanRequest& request, std::span<const M> features) {
  const std::vector<SquareOf<M>> covariances = matrices<M>(request.covariances);
  std::vector<Gaussian<M>> list;
  list.reserve(features.size());
  for (const M& x : features) list.push_back({x, covariances[covariances.size() == 1 ? 0 : list.size()]});
  return list;
}

template <Homogeneous M>
void fuseFeatures(const MeanRequest& request, double* mean, double* covariance) {
  const Features<M> features(request.features);
  const auto at = request.covariances_at_measurement ? CovarianceAt::measured : CovarianceAt::estimated;
  const Gaussian<M> result = fuse(gaussians<M>(request, features.list()), at);
  storePoint(result.mean, mean);
  store(result.covariance, covariance);
}

template <Homogeneous M>
MeanAnswer leastMahalanobis(const MeanRequest& request, SignalWatch& signals) {
  const Features<M> features(request.features);
  const std::vector<Gaussian<M>> samples = gaussians<M>(request, features.list());
  const auto at = request.covariances_at_measurement ? CovarianceAt::measured : CovarianceAt::estimated;
  if (!request.certify) {
    const PythonExecutor executor{request.threads, &signals};
    MahaOptions<M> plain;
    plain.likelihood = request.likelihood;
    const MahaResult<M> result = maha(executor, samples, at, plain);
    MeanAnswer answer;
    Concentration all;
    all.concentrated = liestat::detail::showAMean<M>(samples, result.mean);
    setPlainEstimate<M>(answer, result, result.covariance, all);
    answer.cost = result.cost;
    setDispersion<M>(answer, request, features.list(), result.mean);
    return answer;
  }
  CertifiedMahaOptions<M> how;
  how.maha.likelihood = request.likelihood;
  how.uniqueness = uniquenessOptions(request, signals, how.uniqueness.budget);
  const CertifiedMaha<M> result = certifiedMaha(PythonExecutor{request.threads, &signals}, samples, at, how);
  MeanAnswer answer;
  setEstimate<M>(answer, result.maha, result);
  answer.cost = result.maha.cost;
  answer.concentrated = result.concentration.concentrated;
  answer.fit = result.fit;
  answer.fit_dof = result.fit_dof;
  setDispersion<M>(answer, request, features.list(), result.maha.mean);
  return answer;
}

template <LieGroup G>
MeanAnswer barycentre(const MeanRequest& request, SignalWatch& signals) {
  const Features<G> features(request.features);
  const PythonExecutor executor{request.threads, &signals};
  if (!request.certify) {
    const GroupMeanResult<G> result = request.weights.empty() ? groupMean(executor, features.list())
                                                              : groupMean(executor, features.list(), request.weights);
    MeanAnswer answer;
    answer.law_samples = static_cast<int>(result.n);
    setPlainEstimate<G>(answer, result, result.covarianceFromResiduals(), result.concentration);
    setDispersion<G>(answer, request, features.list(), result.mean);
    return answer;
  }
  CertifiedGroupMeanOptions how;
  how.uniqueness = uniquenessOptions(request, signals, how.uniqueness.budget);
  const CertifiedGroupMean<G> result = request.weights.empty()
                                           ? certifiedGroupMean(executor, features.list(), how)
                                           : certifiedGroupMean(executor, features.list(), request.weights, how);
  MeanAnswer answer;
  setEstimate<G>(answer, result.mean, result);
  answer.concentrated = result.mean.concentration.concentrated;
  answer.law_samples = static_cast<int>(result.mean.n);
  setDispersion<G>(answer, request, features.list(), result.mean.mean);
  return answer;
}

}  // namespace liestat::python
