// certifiedMaha: the Mahalanobis mean (stats/maha.hpp) from several starts, with the rivals found from them, and its
// covariance if that can be trusted. Needs Eigen alone.
//
// No certificate is known for the minimum of this criterion. The starts are the weighted least-squares mean of the same
// measurements (of their metric twins: Frame3 for SE3; lie/concepts.hpp) with its certified search, its rivals and some
// of the measurements; that mean also determines whether the cut locus invalidates the covariance.
#pragma once

#include <lie/frame2.hpp>
#include <lie/frame3.hpp>
#include <stats/certified_mean.hpp>
#include <stats/detail/any_executor.hpp>
#include <stats/detail/metric_twin.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/settled_maha.hpp>
#include <stats/maha.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <ranges>
#include <span>
#include <utility>
#include <vector>

namespace liestat {

/// Options of certifiedMaha().
template <Homogeneous M>
struct CertifiedMahaOptions {
  MahaOptions<M> maha = {};         ///< its start, if there is one, is tried first
  UniquenessOptions uniqueness = {  ///< options for the least-squares mean that gives the starts
      .budget = 10'000'000};
  std::size_t starts_from_data = 6;  ///< number of measurements, spread over the range, that are starts too
  double tie_tolerance = 1e-9;       ///< minima are rivals if their costs c differ by less than this times 1 + |c|
  double distinct = 1e-4;            ///< and they are this far apart, rad and m
  NearTieOptions near_ties = {};     ///< the criterion by which higher minima are rivals; costs are log-likelihoods
  double refutation_level = liestat::refutation_level;  ///< a less probable fit refutes the covariances; 0: none does
  bool scale_noise = false;  ///< multiply the covariance by Birge's factor max(1, χ²/ν), if the noise is not refuted
  /// The covariance is withheld if a Hessian averaged over its region is lower than that at the mean by more than this
  /// fraction: that of MAHA, or of the least-squares mean.
  double largest_hessian_change = liestat::largest_hessian_change;
};

/// A Mahalanobis mean with its rivals and its covariance.
template <Homogeneous M>
struct CertifiedMaha {
  MahaResult<M> maha;                 ///< the best of all starts; among equal ones the first
  UniquenessResult<M> uniqueness;     ///< unique on flat manifolds only; ambiguous if there are rivals
  std::vector<NearTie<M>> near_ties;  ///< other minima that the measurements do not exclude, the nearest tie first
  std::size_t starts = 0;             ///< number of starts from which the iteration was run
  Concentration concentration;        ///< concentration about the weighted least-squares mean
  CutLocusMass cut_locus;             ///< mass at the cut locus of the weighted least-squares mean
  double hessian_change = 0;          ///< as in CertifiedMean, for MAHA's Hessian
  /// As in CertifiedMean: of the least-squares mean, if the likelihood does not reject the end of its valley either.
  double region_factor = 1;
  std::optional<NearTie<M>> valley;
  /// The mean with its covariance; none unless status is ok.
  std::optional<Gaussian<M>> estimate;
  /// A factor of its covariance, as in MahaResult; NaN unless status is ok.
  SquareOf<M> factor = SquareOf<M>::Constant(std::numeric_limits<ScalarOf<M>>::quiet_NaN());
  NoiseFit fit;  ///< Σ μ_i² at the mean, of k (n - 1) degrees of freedom
  Status status = Status::too_few;
  const char* reason = "";  ///< why there is no estimate, in words
};

namespace detail {

/// True for manifolds on which every criterion of a mean has one minimum.
template <Homogeneous M>
constexpr bool isFlat() {
  if constexpr (Factored<M>) {
    return []<std::size_t... I>(std::index_sequence<I...>) {
      return (isFlat<std::tuple_element_t<I, FactorsOf<M>>>() && ...);
    }
    (std::make_index_sequence<std::tuple_size_v<FactorsOf<M>>>{});
  } else {
    return compactFactor<M>() == CompactFactor::none;
  }
}

/// Sets the near ties: the minima of other starts that are higher by less than the noise explains, outside the
/// confidence region of the mean.
template <Homogeneous M>
void setNearTies(CertifiedMaha<M>& result, const std::vector<MahaResult<M>>& others, const SquareOf<M>& region,
                 double distinct, const NearTieOptions& options) {
  const MahaResult<M>& best = result.maha;
  for (const MahaResult<M>& other : others) {
    const double ratio = static_cast<double>(other.cost - best.cost);
    if (other.status != Status::ok || !(ratio < options.log_likelihood_ratio)) continue;
    const TangentOf<M> error = log(best.mean, other.mean);
    const double squared = static_cast<double>(mahalanobisSquared<ScalarOf<M>, ManifoldTraits<M>::DoF>(error, region));
    if (chiSquaredTail(squared, std::size_t{ManifoldTraits<M>::DoF}) > options.region) continue;
    const bool known = std::any_of(result.near_ties.begin(), result.near_ties.end(), [&](const NearTie<M>& tie) {
      return static_cast<double>(log(tie.feature, other.mean).norm()) < distinct;
    });
    // The ratio is half the square of z standard deviations.
    if (!known && static_cast<double>(error.norm()) >= distinct) {
      result.near_ties.push_back({other.mean, std::sqrt(2 * std::max(0.0, ratio)), ratio});
    }
  }
  std::sort(result.near_ties.begin(), result.near_ties.end(),
            [](const NearTie<M>& a, const NearTie<M>& b) { return a.log_likelihood_ratio < b.log_likelihood_ratio; });
}

template <Homogeneous M, Executor E, class R>
CertifiedMaha<M> findCertifiedMaha(const E& executor, const R& samples, CovarianceAt at,
                                   const CertifiedMahaOptions<M>& options, std::span<const SquareOf<M>> factors) {
  CertifiedMaha<M> result;
  const auto without = [&](Status status, const char* reason) {
    result.status = status;
    result.reason = reason;
    return result;
  };
  const std::size_t n = std::ranges::size(samples);
  if (n == 0) return without(Status::too_few, "there are no features");
  std::vector<M> features;
  std::vector<double> weights;
  std::vector<SquareOf<M>> noise;
  features.reserve(n), weights.reserve(n);
  for (const Gaussian<M>& g : samples) {
    features.push_back(g.mean);
    weights.push_back(static_cast<double>(scalarWeight(g.covariance)));
    noise.push_back(g.covariance);
  }

  std::vector<std::optional<M>> starts;
  if (options.maha.start) starts.push_back(options.maha.start);
  Status twin_status = Status::ok;
  const char* twin_reason = "";
  std::optional<NearTie<M>> twin_valley;
  double twin_factor = 1;
  if constexpr (has_metric_twin<M>) {
    using Twin = MetricTwinOf<M>;
    CertifiedMeanOptions<Twin> how;
    how.uniqueness = options.uniqueness;
    how.largest_hessian_change = options.largest_hessian_change;
    how.known_noise = std::move(noise);  // the twin preserves the rotation, and with it the noise that is tested
    how.refutation_level = 0;            // the fit that counts is that of this criterion, below
    // These are the types that certifiedMean uses, so that both share their instantiations.
    const Samples<Twin> twins(metricTwins<M>(features));
    const Samples<double> numbers(std::move(weights));
    const auto twin = meanWithCertificates<Twin>(executor, twins, numbers, how);
    result.cut_locus = twin.cut_locus;
    result.concentration = twin.concentration;
    twin_status = twin.status;
    twin_reason = twin.reason;
    // The start must be exact to rounding and not only to the tolerance, or the number of steps from it would depend on
    // the last digits.
    MeanOptions<Twin> once_more;
    once_more.start = twin.mean.mean;
    starts.push_back(fromTwin<M>(frechetMean<Twin>(executor, twins, numbers, once_more).mean));
    for (const Twin& rival : twin.uniqueness.rivals) starts.push_back(fromTwin<M>(rival));
    for (const NearTie<Twin>& tie : twin.near_ties) starts.push_back(fromTwin<M>(tie.feature));
    if (twin.valley) {
      twin_valley = NearTie<M>{fromTwin<M>(twin.valley->feature), twin.valley->z};
      twin_factor = twin.region_factor;
      starts.push_back(twin_valley->feature);
    }
  } else {
    starts.push_back(std::nullopt);  // the one that maha() chooses
  }
  if constexpr (!isFlat<M>()) {
    constexpr std::size_t many = 20000;  // samples of this size have a smooth and expensive criterion
    const std::size_t several = n > many ? 1 : std::min(options.starts_from_data, n);
    for (std::size_t i = 0; i < several; ++i) starts.push_back(features[i * n / several]);
  }

  std::vector<MahaResult<M>> results;
  for (const std::optional<M>& start : starts) {
    MahaOptions<M> how = options.maha;
    how.start = start;
    results.push_back(mahalanobisMean<M>(executor, samples, at, how, factors));
  }
  result.starts = results.size();
  const auto better = [](const MahaResult<M>& a, const MahaResult<M>& b) {
    if (converged(a.status) != converged(b.status)) return converged(a.status);
    return a.cost < b.cost;
  };
  // Among equal minima the first is the one from the weighted mean.
  result.maha = *std::min_element(results.begin(), results.end(), better);
  const MahaResult<M>& best = result.maha;
  using std::abs;
  std::vector<M> minima{best.mean};
  for (const MahaResult<M>& other : results) {
    const double limit = static_cast<double>(best.cost) + options.tie_tolerance * (1 + std::abs(double(best.cost)));
    if (other.status != Status::ok || !(static_cast<double>(other.cost) <= limit)) continue;
    const bool known = std::any_of(minima.begin(), minima.end(), [&](const M& m) {
      return static_cast<double>(log(m, other.mean).norm()) < options.distinct;
    });
    if (!known) minima.push_back(other.mean);
  }
  result.uniqueness.minimiser = best.mean;
  result.uniqueness.cost = best.cost;
  result.uniqueness.rivals.assign(minima.begin() + 1, minima.end());
  if constexpr (isFlat<M>()) {
    result.uniqueness.unique = Uniqueness::unique;
    result.uniqueness.proof = "the manifold is flat";
    result.uniqueness.r_star = std::numeric_limits<double>::infinity();
  } else if (minima.size() > 1) {
    result.uniqueness.unique = Uniqueness::ambiguous;
    result.uniqueness.proof = "several minima of equal cost";
  } else {
    result.uniqueness.proof = "the best minimum from several starts; there is no certificate for maha";
  }
  result.fit = fitOfMaha<M>(samples, best, at, options.maha.likelihood);

  if (best.status == Status::not_converged) return without(best.status, not_converged_reason);
  if (best.status == Status::ill_defined) return without(best.status, hessian_reason);
  if (best.status != Status::ok) return without(best.status, "this criterion has no answer for these measurements");
  if (result.fit.refuted(options.refutation_level)) return without(Status::inconsistent, refuted_reason);
  if (minima.size() > 1) return without(Status::ambiguous, rival_reason);
  const SettledMaha<M> settled =
      settleMaha(executor, samples, at, options.maha.likelihood, best, options.largest_hessian_change, factors);
  result.hessian_change = settled.change;
  // Noise that is larger than stated lowers the likelihood ratio as it raises χ².
  NearTieOptions near_ties = options.near_ties;
  if (options.refutation_level > 0) near_ties.log_likelihood_ratio *= result.fit.factor();
  setNearTies(result, results, settled.covariance, options.distinct, near_ties);
  if (!result.near_ties.empty()) return without(Status::ambiguous, near_tie_reason);
  if (twin_valley) {
    double chi2 = 0;
    for (const Gaussian<M>& g : samples) chi2 += static_cast<double>(mahalanobisSquared(g, twin_valley->feature, at));
    twin_valley->log_likelihood_ratio = 0.5 * (chi2 - result.fit.chi2);
    if (twin_valley->log_likelihood_ratio < near_ties.log_likelihood_ratio) {
      result.valley = twin_valley, result.region_factor = twin_factor;
      if (twin_status == Status::ambiguous) return without(Status::ambiguous, valley_reason);
    }
  }
  if (twin_status == Status::ill_defined) return without(Status::ill_defined, twin_reason);
  if (!settled.settled) return without(Status::ill_defined, cut_locus_reason);
  result.estimate = Gaussian<M>{best.mean, settled.covariance};
  result.factor = settled.factor;
  if (result.region_factor > 1) {
    result.estimate->covariance = withWidenedAngles<M>(settled.covariance, result.region_factor);
    result.factor = Cholesky<ScalarOf<M>, ManifoldTraits<M>::DoF>(result.estimate->covariance).lower();
  }
  if (options.scale_noise) {
    result.estimate->covariance *= ScalarOf<M>(result.fit.factor());
    result.factor *= ScalarOf<M>(std::sqrt(result.fit.factor()));
  }
  result.status = Status::ok;
  return result;
}

}  // namespace detail

/// The Mahalanobis mean of a range of Gaussian<M> or FactoredGaussian<M> from several starts, with its covariance if
/// that can be trusted: status ok. The covariance is withheld, with the reason in words, if the iteration did not
/// converge, if the measurements scatter more than their covariances say (inconsistent; `fit` says by how much), if
/// several minima are equally low or higher by less than their noise explains (ambiguous), and if the Hessian is
/// singular or, averaged over the confidence region, too flat, or the features are as scattered as uniform ones
/// (ill_defined). The statuses of maha() occur as well. The result has the same bits on any executor.
template <Executor E, detail::AnyRange R, class M = detail::FeatureInSignature<R>>
CertifiedMaha<M> certifiedMaha(const E& executor, R&& samples, CovarianceAt at,
                               const CertifiedMahaOptions<std::type_identity_t<M>>& options = {}) {
  if constexpr (detail::RequireGaussians<R>::ok && detail::RequireGaussians<R>::factored) {
    const detail::FactoredSamples<M> both(samples);
    return detail::findCertifiedMaha<M>(detail::erased(executor), both.gaussians, at, options, both.factors);
  } else if constexpr (detail::RequireGaussians<R>::ok) {
    return detail::findCertifiedMaha<M>(detail::erased(executor), detail::asValues<Gaussian<M>>(samples), at, options,
                                        {});
  } else {
    return {};
  }
}
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
CertifiedMaha<M> certifiedMaha(R&& samples, CovarianceAt at,
                               const CertifiedMahaOptions<std::type_identity_t<M>>& options = {}) {
  return certifiedMaha(SerialExecutor{}, samples, at, options);
}

}  // namespace liestat

#ifdef LIESTAT_COMPILED_MEANS
#include <stats/detail/compiled_certified_maha.hpp>
#endif
