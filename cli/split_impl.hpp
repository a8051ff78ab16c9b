// The template behind split.hpp.
#pragma once

#include <cli/mean_analysis_impl.hpp>
#include <cli/split.hpp>

namespace liestat::cli::detail {

/// Estimates from subsets of the measures, all by the same criterion.
template <class M>
class SplitEstimator {
 public:
  explicit SplitEstimator(const Measures& measures) : measures_(measures), samples_(features<M>(measures.file)) {
    if (measures.criterion == Criterion::maha) gaussians_ = gaussians(samples_, measures.file);
    std::vector<std::size_t> all(samples_.size());
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
    start_ = estimate(all).mean;
  }

  /// Starts at the mean of all the measures once that is known.
  Estimate<M> estimate(const std::vector<std::size_t>& rows) const {
    if (measures_.criterion == Criterion::maha) {
      std::vector<Gaussian<M>> data;
      data.reserve(rows.size());
      for (const std::size_t row : rows) data.push_back(gaussians_[row]);
      MahaOptions<M> options;
      options.start = start_;
      options.likelihood = measures_.likelihood;
      const MahaResult<M> result = maha(data, measures_.covariance_at, options);
      return {result.mean, result.covariance, result.status == Status::ok};
    }
    std::vector<M> samples;
    std::vector<double> weights;
    samples.reserve(rows.size());
    weights.reserve(rows.size());
    for (const std::size_t row : rows) {
      samples.push_back(samples_[row]);
      weights.push_back(measures_.weights[row]);
    }
    if constexpr (is_se3<M>) {
      const GroupMeanResult<M> result = groupMean(samples, weights, start_);
      return {result.mean, result.covarianceFromResiduals(), result.converged};
    } else {
      MeanOptions<M> options;
      options.start = start_;
      const MeanResult<M> result = mean(samples, weights, options);
      const SquareOf<M> covariance =
          measures_.known_noise
              ? covarianceFromNoise(result, weights, noiseAt(result.mean, samples, measures_.file, rows))
              : covarianceFromResiduals(result);
      return {result.mean, covariance, result.converged && covariance.allFinite()};
    }
  }

  /// Squared distance of two estimates under both their covariances; NaN where one of them is not valid.
  static double squaredDistance(const Estimate<M>& a, const Estimate<M>& b) {
    if (!a.valid || !b.valid) return std::numeric_limits<double>::quiet_NaN();
    return mahalanobisSquared(Gaussian<M>{a.mean, a.covariance}, Gaussian<M>{b.mean, b.covariance});
  }

 private:
  const Measures& measures_;
  std::vector<M> samples_;
  std::vector<Gaussian<M>> gaussians_;
  std::optional<M> start_;
};

template <class M>
HalfMean describeHalf(const Estimate<M>& estimate, std::size_t n) {
  HalfMean half{.n = n, .mean = describe(estimate.mean)};
  if (estimate.valid) half.covariance = estimate.covariance;
  return half;
}

template <class M>
SplitResult split(const Measures& measures, const SplitPlan& plan, int threads) {
  const SplitEstimator<M> estimator(measures);
  const auto distances = [&](bool by_blocks) {
    return experiments::ProgramExecutor{threads}.reduce(
        plan.splits,
        [&](std::size_t s) {
          const Halves halves = plan.deal(s, by_blocks);
          const double d =
              SplitEstimator<M>::squaredDistance(estimator.estimate(halves.first), estimator.estimate(halves.second));
          plan.advance();
          return std::vector<double>{plan.equivalentChiSquared(d)};
        },
        [](std::vector<double>& all, const std::vector<double>& more) {
          all.insert(all.end(), more.begin(), more.end());
        });
  };
  SplitResult result;
  result.n = measures.size();
  result.random.distances = distances(false);
  result.by_blocks.distances = distances(true);
  const Estimate<M> first = estimator.estimate(plan.in_time.first), second = estimator.estimate(plan.in_time.second);
  result.first = describeHalf(first, plan.in_time.first.size());
  result.second = describeHalf(second, plan.in_time.second.size());
  result.squared_distance = SplitEstimator<M>::squaredDistance(first, second);
  // Each half's covariance lives in its own frame.
  const std::vector<Gaussian<M>> both{{first.mean, first.covariance}, {second.mean, second.covariance}};
  const Gaussian<M> merged = fuse(both, CovarianceAt::measured);
  result.merged = describeHalf(Estimate<M>{merged.mean, merged.covariance, merged.covariance.allFinite()}, result.n);
  return result;
}

}  // namespace liestat::cli::detail
