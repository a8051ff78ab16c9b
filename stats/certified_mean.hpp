// certifiedMean: a Fréchet mean with the certificates of its uniqueness, and its covariance if that can be trusted.
// Needs Eigen alone.
#pragma once

#include <stats/detail/any_executor.hpp>
#include <stats/detail/bootstrap_region.hpp>
#include <stats/detail/fit_to_noise.hpp>
#include <stats/detail/possible_region.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/weights.hpp>
#include <stats/concentration.hpp>
#include <stats/covariance.hpp>
#include <stats/cut_locus.hpp>
#include <stats/detail/residual_scatter.hpp>
#include <stats/detail/settled_covariance.hpp>
#include <stats/detail/sum_certificates.hpp>
#include <stats/executor.hpp>
#include <stats/gaussian.hpp>
#include <stats/mean.hpp>
#include <stats/mean_region.hpp>
#include <stats/near_ties.hpp>
#include <stats/noise_fit.hpp>
#include <stats/status.hpp>
#include <stats/uniqueness.hpp>

#include <cmath>
#include <cstddef>
#include <optional>
#include <ranges>
#include <type_traits>
#include <vector>

namespace liestat {

/// Options of certifiedMean().
template <Metric M>
struct CertifiedMeanOptions {
  MeanOptions<M> mean = {};
  UniquenessOptions uniqueness = {};
  ResidualNoise noise = ResidualNoise::scaled;  ///< what the weights mean to a covariance from residuals
  /// Covariances of the features' errors if they are known: one for each feature, in its frame (it is transported to
  /// the mean along the geodesic, which has an effect only if the isotropy group is not trivial, as for directions), or
  /// a single one for all features, in the frame of the mean. Empty: the covariance is computed from the residuals.
  std::vector<SquareOf<M>> known_noise = {};
  RefutedNoise refuted_noise = RefutedNoise::withheld;  ///< what becomes of known noise that the measurements refute
  double refutation_level =
      liestat::refutation_level;  ///< known noise is refuted by a less probable fit; 0: not tested
  /// Multiply a covariance from known noise by Birge's factor max(1, χ²/ν), if it is not refuted.
  bool scale_noise = false;
  /// The covariance is withheld if the Hessian averaged over its region is lower than that at the mean by more than
  /// this fraction.
  double largest_hessian_change = liestat::largest_hessian_change;
  NearTieOptions near_ties = {};  ///< the criterion by which higher minima are rivals
  /// The region of a covariance from residuals; that of known noise is χ²'s.
  MeanRegion region = MeanRegion::law;
  BootstrapOptions bootstrap = {};  ///< the draws of MeanRegion::bootstrap
};

/// A mean with its certificates and its covariance.
template <Metric M>
struct CertifiedMean {
  MeanResult<M> mean = {};  ///< the improved one if the search found a lower minimum
  UniquenessResult<M> uniqueness = {};
  Concentration concentration = {};
  std::vector<NearTie<M>> near_ties = {};  ///< other minima that the measurements do not exclude, the nearest tie first
  CutLocusMass cut_locus = {};
  /// The relative decrease of the Hessian averaged over the confidence region (averagedHessian) from that at the mean;
  /// the covariance is that of the averaged one.
  double hessian_change = 0;
  NoiseFit fit = {};        ///< of the measurements to their known noise; nothing where none was stated
  bool from_noise = false;  ///< the covariance follows from the known noise
  /// Covariance from residuals: the number of measurements for Hotelling's law, n but for weights that are no
  /// precisions.
  double law_n = 0;
  /// The factor by which the region of the rotation or direction was widened, until no feature beyond it explains the
  /// measurements as well (docs/theory/means.md, section 7.7); of a product that of the factor which was widened most.
  /// 1: not at all. Of 20 measurements or more status is ambiguous beyond 3.5, or if two thirds of all features are
  /// nearer than such a one.
  double region_factor = 1;
  /// The farthest feature found on the ring or in the valley for which the region was widened, if it was.
  std::optional<NearTie<M>> valley = {};
  MeanRegion region = MeanRegion::law;  ///< of the estimate
  /// MeanRegion::bootstrap: the factor by which the region was widened for the skewness of the noise.
  double skew_factor = 1;
  /// The mean with its covariance, from residuals (Hotelling's law) or from known noise (χ²); none unless status is ok.
  std::optional<Gaussian<M>> estimate = {};
  Status status = Status::too_few;
  const char* reason = "";  ///< why there is no estimate, in words
};

namespace detail {

/// Divisor of the budget of the search for ties if the features are as scattered as uniform ones.
inline constexpr std::size_t scattered_budget_part = 50;

inline constexpr const char* not_converged_reason = "the iteration for the mean did not converge";
inline constexpr const char* refuted_reason =
    "the measurements scatter more than the covariances that are stated for them";
inline constexpr const char* rival_reason = "another feature explains the data as well";
inline constexpr const char* too_few_reason = "a covariance from residuals needs more features than their dimension";
inline constexpr const char* hessian_reason = "the Hessian of the criterion is not positive definite at the mean";
inline constexpr const char* near_tie_reason = "another feature explains the data as well but for their noise";
inline constexpr const char* valley_reason =
    "the features that explain the data as well but for their noise form a ring or a valley, which no covariance "
    "describes";
inline constexpr const char* scattered_reason =
    "the features are as scattered as uniform ones: they have no mean, or too few of them show it";
inline constexpr const char* cut_locus_reason =
    "the criterion is flat within the confidence region of the mean, because features lie near the cut locus: no "
    "first-order covariance is right";

/// The covariance of a mean from the known noise in the options.
template <Metric M, class R, class W>
SquareOf<M> covarianceFromKnownNoise(const R& samples, const W& weights, const MeanResult<M>& mean,
                                     const std::vector<SquareOf<M>>& noise) {
  eigen_assert(noise.size() == 1 || noise.size() == mean.n);
  using S = ScalarOf<M>;
  SquareOf<M> sum = SquareOf<M>::Zero();
  for (std::size_t i = 0; i < mean.n; ++i) {
    const M& x = samples[i];
    const S p = S(weights[i]);
    sum += p * p * (noise.size() == mean.n ? transport(Gaussian<M>{x, noise[i]}, mean.mean).covariance : noise[0]);
  }
  return sandwich(mean, sum);
}

/// Completes `result`, whose mean is there, as findCertifiedMean does for a covariance from residuals, if the sums of
/// the mean's last pass prove all of it. False otherwise; the rest of `result` is of no value then.
template <Metric M>
LIESTAT_NO_INLINE bool certifyBySums(const WeightSums& weights, const CertifiedMeanOptions<M>& options,
                                     CertifiedMean<M>& result) {
  const MeanResult<M>& mean = result.mean;
  if (Factored<M> || !converged(mean.status) || !options.known_noise.empty()) return false;
  if (options.noise != ResidualNoise::scaled) return false;
  if (mean.n <= static_cast<std::size_t>(ManifoldTraits<M>::DoF)) return false;
  if (!std::isfinite(static_cast<double>(mean.cost)) || !(options.largest_hessian_change >= 0)) return false;
  if (!concentrationBySums(mean, weights, result.concentration) || !result.concentration.concentrated) return false;
  result.uniqueness.minimiser = mean.mean;
  result.uniqueness.cost = mean.cost;
  if constexpr (compactFactor<M>() == CompactFactor::none) {
    provesFlat(result.uniqueness);
  } else if constexpr (has_compact_factor<M>) {
    if (!isUniqueBySums(mean, options.uniqueness.tie_tolerance, result.uniqueness)) return false;
    if (!isFarFromRivals(mean) && !haveNoNearTiesBySums(mean, weights, options.near_ties.significance)) return false;
  } else {
    return false;
  }
  const SquareOf<M>& covariance =
      result.estimate.emplace(Gaussian<M>{mean.mean, covarianceFromResiduals(mean, options.noise)}).covariance;
  // Finite variances have finite covariances.
  if (!std::isfinite(static_cast<double>(covariance.trace())) ||
      !isHessianSettledBySums<M>(mean, covariance, averagingWidth(mean.n)) ||
      !isFarFromCutLocusBySums<M>(mean, covariance, result.cut_locus)) {
    return false;
  }
  result.law_n = static_cast<double>(mean.n);
  result.status = Status::ok;
  return true;
}

/// `first` is the mean of the same features and weights, by options.mean. Looks at the features again for whatever the
/// sums of its last pass do not prove.
template <Metric M, Executor E, class R, class W>
CertifiedMean<M> findCertifiedMean(const E& executor, const R& samples, const W& weights,
                                   const CertifiedMeanOptions<M>& options, const MeanResult<M>& first) {
  eigen_assert(haveOneSize(samples, weights));
  CertifiedMean<M> result;
  const auto without = [&](Status status, const char* reason) {
    result.status = status;
    result.reason = reason;
    return result;
  };
  result.mean = first;
  if (result.mean.n == 0) return without(Status::too_few, "there are no features");
  bool known = !options.known_noise.empty();
  // If the noise is known and both noise and scatter are small, the test for the existence of a mean is skipped.
  const auto isScattered = [&](const Concentration& concentration) {
    const bool modest = known && (result.mean.n == 1 ||
                                  (concentration.isModest() && isModestNoise(result.mean.mean, options.known_noise)));
    return !concentration.concentrated && !modest;
  };
  const auto search = [&](std::size_t budget_part) {
    UniquenessOptions how = options.uniqueness;
    how.budget /= budget_part;
    result.uniqueness = findUniqueness(executor, samples, weights, result.mean, how);
    if (!result.uniqueness.improved) return;
    MeanOptions<M> from_there = options.mean;
    from_there.start = result.uniqueness.minimiser;
    result.mean = frechetMean<M>(executor, samples, weights, from_there);
  };
  // Samples that have no covariance anyway are searched for ties only with a small budget.
  const bool seems_scattered = isScattered(findConcentration<M>(samples, weights, result.mean));
  search(seems_scattered ? scattered_budget_part : 1);
  if (seems_scattered && result.uniqueness.improved &&
      !isScattered(findConcentration<M>(samples, weights, result.mean))) {
    search(1);
  }
  if (!converged(result.mean.status)) return without(Status::not_converged, not_converged_reason);
  result.from_noise = known;
  if (known && options.refutation_level > 0) {
    result.fit = fitToNoise<M>(executor, samples, options.known_noise, result.mean.mean);
    const bool refuted = result.fit.refuted(options.refutation_level);
    if (refuted && options.refuted_noise == RefutedNoise::withheld) {
      return without(Status::inconsistent, refuted_reason);
    }
    known = result.from_noise = !refuted;
  }
  if (result.uniqueness.unique == Uniqueness::ambiguous) return without(Status::ambiguous, rival_reason);

  // The region is that of the residuals, regardless of the stated noise; that of the known noise if there are too few
  // residuals.
  const bool have_residuals = result.mean.n > static_cast<std::size_t>(ManifoldTraits<M>::DoF);
  if (!have_residuals && !known) return without(Status::too_few, too_few_reason);
  result.concentration = findConcentration<M>(samples, weights, result.mean);
  const auto known_covariance = [&](const MeanResult<M>& mean) {
    return covarianceFromKnownNoise(samples, weights, mean, options.known_noise);
  };
  ResidualScatter<M> residuals;
  if (have_residuals) {
    residuals = residualScatter<M>(samples, weights, result.mean, options.noise);
    if (residuals.reason != nullptr && !known) return without(Status::too_few, residuals.reason);
    if (residuals.reason != nullptr)
      residuals = residualScatter<M>(samples, weights, result.mean, ResidualNoise::scaled);
    if (!known) result.law_n = residuals.n;
  }
  const auto from_residuals = [&](const MeanResult<M>& mean) { return sandwich(mean, residuals.scatter); };
  const SettledCovariance<M> settled =
      have_residuals
          ? settleCovariance(samples, weights, result.mean, options.largest_hessian_change, from_residuals)
          : settleCovariance(samples, weights, result.mean, options.largest_hessian_change, known_covariance);
  result.hessian_change = settled.change;
  if (!settled.first.allFinite()) return without(Status::ill_defined, hessian_reason);
  result.cut_locus = findCutLocusNearby(samples, weights, result.mean, settled.first);
  // For very large samples near ties cost seconds, and here nothing depends on them.
  const bool scattered = isScattered(result.concentration);
  if (scattered && result.mean.n > max_averaged) return without(Status::ill_defined, scattered_reason);
  const SquareOf<M>& region = settled.settled ? settled.covariance : settled.first;
  if (known) {
    const auto noise = [&](std::size_t i) -> const SquareOf<M>& {
      return options.known_noise[options.known_noise.size() == 1 ? 0 : i];
    };
    // Noise that is larger than stated lowers the likelihood ratio as it raises χ².
    NearTieOptions near_ties = options.near_ties;
    near_ties.log_likelihood_ratio *= result.fit.factor();
    result.near_ties =
        findNearTies<M>(executor, samples, weights, result.mean, region, have_residuals, noise, near_ties);
  } else {
    result.near_ties =
        findNearTies<M>(executor, samples, weights, result.mean, region, true, NoNoise{}, options.near_ties);
  }
  if (scattered) return without(Status::ill_defined, scattered_reason);
  if (!result.near_ties.empty()) return without(Status::ambiguous, near_tie_reason);
  if (!settled.settled) return without(Status::ill_defined, cut_locus_reason);
  SquareOf<M> covariance = settled.covariance;
  if (known && have_residuals) {
    MeanResult<M> averaged = result.mean;
    averaged.hessian = settled.hessian;
    covariance = withAveragedGrowth<M>(known_covariance(result.mean), known_covariance(averaged));
    if (!covariance.allFinite()) return without(Status::ill_defined, hessian_reason);
  }
  if (have_residuals) {
    const GrownRegion<M> grown =
        growRegion<M>(executor, samples, weights, result.mean, settled.covariance, options.noise, covariance);
    result.region_factor = grown.factor;
    result.valley = grown.farthest;
    if (grown.open) return without(Status::ambiguous, valley_reason);
  }
  if (known && options.scale_noise) covariance *= ScalarOf<M>(result.fit.factor());
  result.estimate = Gaussian<M>{result.mean.mean, covariance};
  result.status = Status::ok;
  return result;
}

/// Widens the region of a certified mean, whose covariance is from residuals, by a bootstrap if the options ask for it.
template <class M, class R, class W, class Options, class Result>
void bootstrapRegion(const R& samples, const W& weights, const Options& options, Result& result) {
  if (options.region == MeanRegion::law || !result.estimate || result.from_noise) return;
  result.region = MeanRegion::bootstrap;
  const double widened =
      bootstrapWidening<M>(samples, weights, result.mean, options.noise, result.law_n, options.bootstrap);
  result.skew_factor = std::sqrt(widened);
  if (std::isfinite(widened)) {
    result.estimate->covariance *= ScalarOf<M>(widened);
  } else {
    result.estimate.reset();
    result.status = Status::too_few, result.reason = unbounded_region_reason;
  }
}

/// The mean of features with its certificates, by the sums of its last pass if they prove all of them.
template <Metric M, Executor E, class R, class W>
CertifiedMean<M> meanWithCertificates(const E& executor, const R& samples, const W& weights,
                                      const CertifiedMeanOptions<M>& options) {
  CertifiedMean<M> result{.mean = frechetMean<M>(executor, samples, weights, options.mean)};
  // In a flat space no certificate depends on the weights.
  constexpr bool flat = compactFactor<M>() == CompactFactor::none;
  const WeightSums sums = flat ? WeightSums::ofOnes(result.mean.n) : weightSums(weights, result.mean.n);
  if (!certifyBySums(sums, options, result)) {
    result = findCertifiedMean<M>(executor, samples, weights, options, result.mean);
  }
  bootstrapRegion<M>(samples, weights, options, result);
  return result;
}

}  // namespace detail

/// The mean of a range of features, certified, with its covariance from the residuals, or from known noise, if that can
/// be trusted: status ok. The covariance is withheld, with the reason in words, if the measurements refute the noise
/// that is stated for them (inconsistent; `fit` says by how much), if another feature explains the measurements as
/// well, exactly or up to their noise (ambiguous), if the features are as scattered as uniform ones or the criterion is
/// flat within the confidence region (ill_defined), if there are no more features than dimensions and the noise is not
/// known, or too few for a bootstrap that the options ask for (too_few), or if the weights are invalid
/// (not_applicable). A mean that is merely not certified to be unique keeps its covariance. The result has the same
/// bits on any executor.
template <Executor E, detail::AnyRange R, class M = detail::MetricInSignature<R>>
CertifiedMean<M> certifiedMean(const E& executor, R&& samples,
                               const CertifiedMeanOptions<std::type_identity_t<M>>& options = {}) {
  if constexpr (detail::RequireMean<R>::ok) {
    const auto features = detail::asSamples(samples);
    const std::size_t n = features.size();
    CertifiedMean<M> result{.mean = detail::frechetMean<M>(executor, features, detail::UnitWeights{}, options.mean)};
    if (!detail::certifyBySums(detail::WeightSums::ofOnes(n), options, result)) {
      result = detail::findCertifiedMean<M>(detail::erased(executor), features, detail::ones(n), options, result.mean);
    }
    if (options.region == MeanRegion::bootstrap) {
      detail::bootstrapRegion<M>(features, detail::ones(n), options, result);
    }
    return result;
  } else {
    return {};
  }
}
template <detail::AnyRange R, class M = detail::MetricInSignature<R>>
CertifiedMean<M> certifiedMean(R&& samples, const CertifiedMeanOptions<std::type_identity_t<M>>& options = {}) {
  return certifiedMean(SerialExecutor{}, samples, options);
}
template <Executor E, detail::AnyRange R, detail::AnyRange W, class M = detail::MetricInSignature<R>>
CertifiedMean<M> certifiedMean(const E& executor, R&& samples, W&& weights,
                               const CertifiedMeanOptions<std::type_identity_t<M>>& options = {}) {
  if constexpr (detail::RequireMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<M>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows& rows) {
          CertifiedMeanOptions<M> how = options;
          how.known_noise = rows.of(options.known_noise);
          return detail::meanWithCertificates<M>(detail::erased(executor), features, numbers, how);
        },
        [] { return detail::without<CertifiedMean<M>>(Status::not_applicable, detail::bad_weights_reason); });
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class M = detail::MetricInSignature<R>>
CertifiedMean<M> certifiedMean(R&& samples, W&& weights,
                               const CertifiedMeanOptions<std::type_identity_t<M>>& options = {}) {
  return certifiedMean(SerialExecutor{}, samples, weights, options);
}

}  // namespace liestat

#ifdef LIESTAT_COMPILED_MEANS
#include <stats/detail/compiled_certified_mean.hpp>
#endif
