// certifiedGroupMean: the exponential barycentre of a Lie group with the certificates of its uniqueness, and its
// covariance if that can be trusted. Needs Eigen alone.
//
// The rotation of a barycentre of rigid motions is the Riemannian mean of the rotations, and the translation follows
// from that by linear equations: it is unique if the mean of the metric twin is (Frame3 for SE3, Frame2 for SE2;
// HasMetricTwin in lie/concepts.hpp). A group with an invariant metric (SO3) is its own twin. Other groups (SE23, Sim3)
// are not certified.
#pragma once

#include <lie/frame2.hpp>
#include <lie/frame3.hpp>
#include <stats/detail/any_executor.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/weights.hpp>
#include <stats/certified_mean.hpp>
#include <stats/detail/metric_twin.hpp>
#include <stats/detail/residual_scatter.hpp>
#include <stats/detail/settled_group_mean.hpp>
#include <stats/group_mean.hpp>
#include <stats/noise_fit.hpp>

#include <optional>
#include <ranges>
#include <type_traits>
#include <vector>

namespace liestat {

/// Options of certifiedGroupMean().
template <LieGroup G>
struct CertifiedGroupMeanOptions {
  UniquenessOptions uniqueness = {};
  /// Covariances of the elements' errors e_i, x_i = x Exp(e_i), if they are known: one for each, or a single one.
  std::vector<SquareOf<G>> known_noise = {};
  RefutedNoise refuted_noise = RefutedNoise::withheld;  ///< what becomes of known noise that the elements refute
  double refutation_level =
      liestat::refutation_level;                ///< known noise is refuted by a less probable fit; 0: not tested
  ResidualNoise noise = ResidualNoise::scaled;  ///< what the weights mean to a covariance from residuals
  bool scale_noise = false;  ///< multiply by Birge's factor max(1, χ²/ν), if the noise is not refuted
  /// The covariance is withheld if the Hessian of the twin's mean, or without a twin the equations of the barycentre,
  /// averaged over the confidence region, are flatter than those at the mean by more than this fraction.
  double largest_hessian_change = liestat::largest_hessian_change;
  MeanRegion region = MeanRegion::law;  ///< of a covariance from residuals, as in CertifiedMeanOptions
  BootstrapOptions bootstrap = {};      ///< the draws of MeanRegion::bootstrap
};

/// A barycentre with its certificates and its covariance.
template <LieGroup G>
struct CertifiedGroupMean {
  GroupMeanResult<G> mean;
  UniquenessResult<G> uniqueness;     ///< uniqueness of the twin's mean, its rivals as barycentres; cost is the twin's
  std::vector<NearTie<G>> near_ties;  ///< those of the twin's mean, as barycentres
  CutLocusMass cut_locus;             ///< mass at the cut locus of the twin's mean
  double hessian_change = 0;          ///< how much flatter the barycentre's equations are across the confidence region
  double region_factor = 1;           ///< as in CertifiedMean: that of the twin's mean
  std::optional<NearTie<G>> valley;   ///< as in CertifiedMean, as a barycentre
  NoiseFit fit;                       ///< of the elements to their known noise; nothing where none was stated
  bool from_noise = false;            ///< the covariance follows from the known noise
  double law_n = 0;                   ///< as CertifiedMean's
  MeanRegion region = MeanRegion::law;  ///< as CertifiedMean's
  double skew_factor = 1;               ///< as CertifiedMean's
  /// The barycentre with its covariance, from residuals or from known noise; none unless status is ok.
  std::optional<Gaussian<G>> estimate;
  Status status = Status::too_few;
  const char* reason = "";  ///< why there is no estimate, in words
};

namespace detail {

template <LieGroup G, Executor E, class R, class W>
CertifiedGroupMean<G> findCertifiedGroupMean(const E& executor, const R& samples, const W& weights,
                                             const CertifiedGroupMeanOptions<G>& options) {
  eigen_assert(haveOneSize(samples, weights));
  CertifiedGroupMean<G> result;
  const auto without = [&](Status status, const char* reason) {
    result.status = status;
    result.reason = reason;
    return result;
  };
  const auto from = [&](const std::optional<G>& start) {
    return groupBarycentre<G>(executor, samples, weights, start);
  };
  Status twin_status = Status::ok;
  const char* twin_reason = "";
  if constexpr (has_metric_twin<G>) {
    using Twin = MetricTwinOf<G>;
    CertifiedMeanOptions<Twin> how;
    how.uniqueness = options.uniqueness;
    how.largest_hessian_change = options.largest_hessian_change;
    how.known_noise = options.known_noise;  // the twin preserves the rotation, whose noise is that of its near ties
    how.refutation_level = 0;               // the noise of poses is tested below
    const Samples<Twin> twins(metricTwins<G>(samples));
    const CertifiedMean<Twin> twin = meanWithCertificates<Twin>(executor, twins, weights, how);
    result.mean = from(fromTwin<G>(twin.mean.mean));
    result.uniqueness = {twin.uniqueness.unique,
                         {},
                         twin.uniqueness.improved,
                         twin.uniqueness.cost,
                         {},
                         twin.uniqueness.r_star,
                         twin.uniqueness.cells,
                         twin.uniqueness.proof,
                         twin.uniqueness.more_rivals};
    for (const Twin& rival : twin.uniqueness.rivals) {
      result.uniqueness.rivals.push_back(from(fromTwin<G>(rival)).mean);
    }
    for (const NearTie<Twin>& tie : twin.near_ties) {
      result.near_ties.push_back({from(fromTwin<G>(tie.feature)).mean, tie.z, tie.log_likelihood_ratio});
    }
    result.region_factor = twin.region_factor;
    if (twin.valley) {
      result.valley = NearTie<G>{from(fromTwin<G>(twin.valley->feature)).mean, twin.valley->z};
    }
    result.cut_locus = twin.cut_locus;
    twin_status = twin.status;
    twin_reason = twin.reason;
  } else {
    result.mean = from(std::nullopt);
    if (options.known_noise.empty() && result.mean.n <= static_cast<std::size_t>(G::DoF))
      twin_status = Status::too_few, twin_reason = too_few_reason;
  }
  result.uniqueness.minimiser = result.mean.mean;
  if (result.mean.n == 0) return without(Status::too_few, "there are no features");
  if (!converged(result.mean.status)) return without(Status::not_converged, not_converged_reason);
  bool known = !options.known_noise.empty();
  result.from_noise = known;
  if (known && options.refutation_level > 0) {
    result.fit = fitToNoise<G>(executor, samples, options.known_noise, result.mean.mean);
    const bool refuted = result.fit.refuted(options.refutation_level);
    if (refuted && options.refuted_noise == RefutedNoise::withheld) {
      return without(Status::inconsistent, refuted_reason);
    }
    known = result.from_noise = !refuted;
  }
  if (twin_status != Status::ok) return without(twin_status, twin_reason);
  const bool have_residuals = result.mean.n > static_cast<std::size_t>(G::DoF);
  if (!have_residuals && !known) return without(Status::too_few, too_few_reason);
  if (have_residuals && !result.mean.concentration.concentrated) return without(Status::ill_defined, scattered_reason);
  const auto from_noise = [&](const GroupMeanResult<G>& mean) {
    SquareOf<G> sum = SquareOf<G>::Zero();
    for (std::size_t i = 0; i < mean.n; ++i) {
      const auto p = static_cast<ScalarOf<G>>(weights[i]);
      sum += p * p * options.known_noise[options.known_noise.size() == 1 ? 0 : i];
    }
    return congruence(inverse<ScalarOf<G>, G::DoF>(mean.jacobian), sum);
  };
  ResidualScatter<G> residuals;
  if (have_residuals) {
    residuals = residualScatter<G>(samples, weights, result.mean, options.noise);
    if (residuals.reason != nullptr && !known) return without(Status::too_few, residuals.reason);
    if (residuals.reason != nullptr)
      residuals = residualScatter<G>(samples, weights, result.mean, ResidualNoise::scaled);
    if (!known) result.law_n = residuals.n;
  }
  const auto from_residuals = [&](const GroupMeanResult<G>& mean) {
    return congruence(inverse<ScalarOf<G>, G::DoF>(mean.jacobian), residuals.scatter);
  };
  const double largest_change = options.largest_hessian_change;
  const SettledGroupMean<G> settled =
      have_residuals ? settleGroupMean(samples, weights, result.mean, largest_change, from_residuals)
                     : settleGroupMean(samples, weights, result.mean, largest_change, from_noise);
  result.hessian_change = settled.change;
  if (!settled.first.allFinite()) return without(Status::ill_defined, "the equations of the barycentre are singular");
  if (!settled.settled) return without(Status::ill_defined, cut_locus_reason);
  SquareOf<G> covariance = settled.covariance;
  if (known && have_residuals) {
    GroupMeanResult<G> averaged = result.mean;
    averaged.jacobian = settled.jacobian;
    covariance = withAveragedAngles<G>(from_noise(result.mean), from_noise(averaged));
  }
  covariance = withWidenedAngles<G>(covariance, result.region_factor);
  if (known && options.scale_noise) covariance *= ScalarOf<G>(result.fit.factor());
  result.estimate = Gaussian<G>{result.mean.mean, covariance};
  result.status = Status::ok;
  bootstrapRegion<G>(samples, weights, options, result);
  return result;
}

}  // namespace detail

/// The exponential barycentre of a range of group elements, weighted or not, certified by the mean of its metric twin,
/// with its covariance from the residuals, or from known noise, if that can be trusted: status ok. The result has the
/// same bits on any executor.
template <Executor E, detail::AnyRange R, class G = detail::GroupInSignature<R>>
CertifiedGroupMean<G> certifiedGroupMean(const E& executor, R&& samples,
                                         const CertifiedGroupMeanOptions<std::type_identity_t<G>>& options = {}) {
  if constexpr (detail::RequireGroupMean<R>::ok) {
    const auto elements = detail::asSamples(samples);
    return detail::findCertifiedGroupMean<G>(detail::erased(executor), elements, detail::ones(elements.size()),
                                             options);
  } else {
    return {};
  }
}
template <detail::AnyRange R, class G = detail::GroupInSignature<R>>
CertifiedGroupMean<G> certifiedGroupMean(R&& samples,
                                         const CertifiedGroupMeanOptions<std::type_identity_t<G>>& options = {}) {
  return certifiedGroupMean(SerialExecutor{}, samples, options);
}
template <Executor E, detail::AnyRange R, detail::AnyRange W, class G = detail::GroupInSignature<R>>
CertifiedGroupMean<G> certifiedGroupMean(const E& executor, R&& samples, W&& weights,
                                         const CertifiedGroupMeanOptions<std::type_identity_t<G>>& options = {}) {
  if constexpr (detail::RequireGroupMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<G>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows& rows) {
          CertifiedGroupMeanOptions<G> how = options;
          how.known_noise = rows.of(options.known_noise);
          return detail::findCertifiedGroupMean<G>(detail::erased(executor), features, numbers, how);
        },
        [] { return detail::without<CertifiedGroupMean<G>>(Status::not_applicable, detail::bad_weights_reason); });
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class G = detail::GroupInSignature<R>>
CertifiedGroupMean<G> certifiedGroupMean(R&& samples, W&& weights,
                                         const CertifiedGroupMeanOptions<std::type_identity_t<G>>& options = {}) {
  return certifiedGroupMean(SerialExecutor{}, samples, weights, options);
}

}  // namespace liestat

#ifdef LIESTAT_COMPILED_MEANS
#include <stats/detail/compiled_certified_group_mean.hpp>
#endif
