// Is the covariance of a mean true of real data? Pennec 1998, section 5.2: the measurements are split in two, each half
// has its mean with a covariance, and the squared distance of both means under the sum of both covariances should
// follow its law. Splits at random do not see errors that successive measurements share, splits by blocks of time do.
#pragma once

#include <stats/certified_mean.hpp>
#include <stats/detail/splits.hpp>
#include <stats/executor.hpp>
#include <stats/group_mean.hpp>
#include <stats/inference.hpp>
#include <stats/maha.hpp>
#include <stats/mean.hpp>
#include <stats/split_validation_types.hpp>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <ranges>
#include <utility>
#include <vector>

namespace liestat {

/// A mean of some of the measurements with its covariance.
template <Homogeneous M>
struct SplitEstimate {
  Gaussian<M> estimate;
  bool valid = false;  ///< the mean converged and its covariance is finite
};

/// A part of the measurements and what was estimated from them.
template <Homogeneous M>
struct SplitPart {
  std::size_t n = 0;
  SplitEstimate<M> result;
};

/// The result of validateBySplitting().
template <Homogeneous M>
struct SplitValidation {
  std::size_t n = 0;
  SplitSeries random, by_blocks;
  SplitPart<M> first, second;                      ///< the halves in time
  SplitPart<M> merged;                             ///< both fused
  double squared_distance = 0;                     ///< distance of the halves in time; NaN if one is not valid
  double p_value = 0;                              ///< probability of so large a distance
  ReferenceLaw law = ReferenceLaw::chiSquared(0);  ///< law of the squared distances
};

/// The law of the squared distance of two halves of n measurements. With equal halves the sum of both residual
/// covariances is twice the pooled one, which has n - 2 degrees of freedom.
template <Homogeneous M>
ReferenceLaw lawOfHalves(std::size_t n, bool known_noise) {
  constexpr int k = ManifoldTraits<M>::DoF;
  return known_noise ? ReferenceLaw::chiSquared(k)
                     : ReferenceLaw::hotelling(k, static_cast<int>(std::min<std::size_t>(n, 1000000000)) - 1);
}

/// The measurements that are split, for validateBySplitting().
struct SplitData {
  std::vector<double> information;  ///< information of each as a number: its weight, or det(Σ)^(-1/k)
  std::vector<double> times = {};   ///< time of each; empty: they are in order
};

/// All splits of measurements of which there are enough. `estimate(rows)` is the SplitEstimate<M> of the measurements
/// with these indices (std::vector<std::size_t>), called on any thread. The same bits on any executor.
template <Homogeneous M, Executor E, class Estimate>
  requires std::convertible_to < std::invoke_result_t < const Estimate&, const std::vector<std::size_t>
& >, SplitEstimate < M >> SplitValidation<M> validateBySplitting(const E& executor, const SplitData& data,
                                                                 const ReferenceLaw& law, const Estimate& estimate,
                                                                 const SplitOptions& options = {}) {
  const std::size_t n = data.information.size();
  const double k = ManifoldTraits<M>::DoF;
  const detail::Timeline timeline(n, options.blocks, data.times);
  const auto dealt = [&](std::size_t split, bool by_blocks) {
    CounterRng rng(options.seed, split, by_blocks ? 1 : 0);
    return detail::dealInHalves(by_blocks ? options.blocks : n, rng);
  };
  const auto squaredDistance = [](const SplitEstimate<M>& a, const SplitEstimate<M>& b) {
    if (!a.valid || !b.valid) return std::numeric_limits<double>::quiet_NaN();
    return static_cast<double>(mahalanobisSquared(a.estimate, b.estimate));
  };
  const auto equivalent = [&](double d) {
    const double same_rank = law.equivalentChiSquared(d);
    // So far out that the probability is zero in doubles the rank is lost, and the distance itself says enough.
    return std::isinf(same_rank) ? d : same_rank;
  };
  const auto series = [&](bool by_blocks) {
    SplitSeries s;
    s.distances = executor.reduce(
        options.splits,
        [&](std::size_t split) {
          const detail::Halves halves = timeline.halves(dealt(split, by_blocks), by_blocks);
          const double d = squaredDistance(estimate(halves.first), estimate(halves.second));
          options.advance();
          return std::vector<double>{equivalent(d)};
        },
        [](std::vector<double>& all, const std::vector<double>& more) {
          all.insert(all.end(), more.begin(), more.end());
        });
    double sum = 0;
    std::size_t count = 0;
    for (const double d : s.distances) {
      if (std::isfinite(d)) sum += d, ++count;
    }
    s.failures = s.distances.size() - count;
    s.index = count > 0 ? sum / static_cast<double>(count) : std::numeric_limits<double>::quiet_NaN();
    s.dof = k;
    return s;
  };

  SplitValidation<M> result;
  result.n = n;
  result.law = law;
  result.random = series(false);
  result.by_blocks = series(true);

  std::vector<char> early(n, 0);
  std::fill(early.begin(), early.begin() + static_cast<std::ptrdiff_t>(n / 2), char{1});
  const detail::Halves in_time = timeline.halves(early, false);
  result.first = {in_time.first.size(), estimate(in_time.first)};
  result.second = {in_time.second.size(), estimate(in_time.second)};
  result.squared_distance = squaredDistance(result.first.result, result.second.result);
  result.p_value = law.survival(result.squared_distance);
  // Each half's covariance lives in its own frame.
  const std::vector<Gaussian<M>> both{result.first.result.estimate, result.second.result.estimate};
  // Their distance has a test of its own, under the law of these covariances.
  result.merged = {n, {testedFuse(both, CovarianceAt::measured).estimate, false}};
  result.merged.result.valid = result.merged.result.estimate.covariance.allFinite();

  std::vector<std::vector<char>> deals;
  for (std::size_t s = 0; s < options.splits; ++s) deals.push_back(dealt(s, true));
  std::vector<double> in_block(options.blocks, 0.0);
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double w = data.information[timeline.row(i)];
    in_block[timeline.blockOf(i)] += w;
    sum += w;
    squares += w * w;
  }
  result.by_blocks.effective_dof = k * detail::dealtDegreesOfFreedom(in_block, deals);
  // As if each measurement were a block; the share of the finite number of splits added.
  const double measurements_dof = std::max(1.0, sum * sum / squares - 1);
  result.random.effective_dof = k / (1 / measurements_dof + 1 / static_cast<double>(options.splits));
  return result;
}

namespace detail {

/// The elements of a list with the given indices.
template <class T>
std::vector<T> selected(const std::vector<T>& list, const std::vector<std::size_t>& rows) {
  std::vector<T> some;
  some.reserve(rows.size());
  for (const std::size_t row : rows) some.push_back(list[row]);
  return some;
}
inline std::vector<std::size_t> allRows(std::size_t n) {
  std::vector<std::size_t> all(n);
  std::iota(all.begin(), all.end(), std::size_t{0});
  return all;
}
/// estimate(rows, start), started at the estimate of all measurements.
template <Homogeneous M, class Estimate>
auto startedAtTheWhole(const Estimate& estimate, std::size_t n) {
  return [&estimate, start = std::optional<M>(estimate(allRows(n), std::optional<M>()).estimate.mean)](
             const std::vector<std::size_t>& rows) { return estimate(rows, start); };
}

}  // namespace detail

/// The same of weighted Fréchet means. Covariances come from the residuals, or from known noise as in
/// CertifiedMeanOptions (one covariance for each feature).
template <Executor E, Metric M>
SplitValidation<M> validateMeanBySplitting(const E& executor, const std::vector<M>& samples,
                                           const std::vector<double>& weights,
                                           const std::vector<SquareOf<M>>& known_noise = {},
                                           const std::vector<double>& times = {}, const SplitOptions& options = {}) {
  eigen_assert(weights.size() == samples.size() && (known_noise.empty() || known_noise.size() == samples.size()));
  const auto estimate = [&](const std::vector<std::size_t>& rows, const std::optional<M>& start) {
    const std::vector<M> some = detail::selected(samples, rows);
    const std::vector<double> their_weights = detail::selected(weights, rows);
    MeanOptions<M> how;
    how.start = start;
    return detail::withRelativeWeights<M>(
        detail::asSamples(some), detail::asWeights(their_weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows& kept) {
          const MeanResult<M> result = detail::frechetMean<M>(detail::erased(SerialExecutor{}), features, numbers, how);
          const SquareOf<M> covariance =
              known_noise.empty() ? covarianceFromResiduals(result)
                                  : detail::covarianceFromKnownNoise(features, numbers, result,
                                                                     kept.of(detail::selected(known_noise, rows)));
          return SplitEstimate<M>{{result.mean, covariance}, converged(result.status) && covariance.allFinite()};
        },
        [] {
          return SplitEstimate<M>{{}, false};
        });
  };
  return validateBySplitting<M>(executor, {weights, times}, lawOfHalves<M>(samples.size(), !known_noise.empty()),
                                detail::startedAtTheWhole<M>(estimate, samples.size()), options);
}

/// The same of Mahalanobis means (stats/maha.hpp).
template <Executor E, Homogeneous M>
SplitValidation<M> validateMahaBySplitting(const E& executor, const std::vector<Gaussian<M>>& samples, CovarianceAt at,
                                           const MahaOptions<M>& maha_options = {},
                                           const std::vector<double>& times = {}, const SplitOptions& options = {}) {
  SplitData data{{}, times};
  for (const Gaussian<M>& g : samples) data.information.push_back(static_cast<double>(scalarWeight(g.covariance)));
  const auto estimate = [&](const std::vector<std::size_t>& rows, const std::optional<M>& start) {
    MahaOptions<M> how = maha_options;
    how.start = start;
    how.refutation_level = 0;  // the halves test the covariances
    const MahaResult<M> result = maha(detail::selected(samples, rows), at, how);
    return SplitEstimate<M>{result.estimate(), result.status == Status::ok};
  };
  return validateBySplitting<M>(executor, data, lawOfHalves<M>(samples.size(), true),
                                detail::startedAtTheWhole<M>(estimate, samples.size()), options);
}

/// The same of exponential barycentres (stats/group_mean.hpp).
template <Executor E, LieGroup G>
SplitValidation<G> validateGroupMeanBySplitting(const E& executor, const std::vector<G>& samples,
                                                const std::vector<double>& weights,
                                                const std::vector<double>& times = {},
                                                const SplitOptions& options = {}) {
  eigen_assert(weights.size() == samples.size());
  const auto estimate = [&](const std::vector<std::size_t>& rows, const std::optional<G>& start) {
    const GroupMeanResult<G> result =
        groupMean(detail::selected(samples, rows), detail::selected(weights, rows), start);
    return SplitEstimate<G>{{result.mean, result.covarianceFromResiduals()}, converged(result.status)};
  };
  return validateBySplitting<G>(executor, {weights, times}, lawOfHalves<G>(samples.size(), false),
                                detail::startedAtTheWhole<G>(estimate, samples.size()), options);
}

}  // namespace liestat
