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
#include <stats/detail/settled_group_mean.hpp>
#include <stats/group_mean.hpp>

#include <optional>
#include <ranges>
#include <vector>

namespace liestat {

/// Options of certifiedGroupMean().
struct CertifiedGroupMeanOptions {
  UniquenessOptions uniqueness = {};
  /// The covariance is withheld if the Hessian of the twin's mean, or without a twin the equations of the barycentre,
  /// averaged over the confidence region, are flatter than those at the mean by more than this fraction.
  double largest_hessian_change = liestat::largest_hessian_change;
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
  /// The barycentre with its covariance from residuals; none unless status is ok.
  std::optional<Gaussian<G>> estimate;
  Status status = Status::too_few;
  const char* reason = "";  ///< why there is no estimate, in words
};

namespace detail {

template <LieGroup G, Executor E, class R, class W>
CertifiedGroupMean<G> findCertifiedGroupMean(const E& executor, const R& samples, const W& weights,
                                             const CertifiedGroupMeanOptions& options) {
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
    if (result.mean.n <= static_cast<std::size_t>(G::DoF)) twin_status = Status::too_few, twin_reason = too_few_reason;
  }
  result.uniqueness.minimiser = result.mean.mean;
  if (result.mean.n == 0) return without(Status::too_few, "there are no features");
  if (!converged(result.mean.status)) return without(Status::not_converged, not_converged_reason);
  if (twin_status != Status::ok) return without(twin_status, twin_reason);
  if (!result.mean.concentration.concentrated) return without(Status::ill_defined, scattered_reason);
  const SquareOf<G> covariance = result.mean.covarianceFromResiduals();
  if (!covariance.allFinite()) return without(Status::ill_defined, "the equations of the barycentre are singular");
  const SettledGroupMean<G> settled = settleGroupMean(samples, weights, result.mean, options.largest_hessian_change);
  result.hessian_change = settled.change;
  if (!settled.settled) return without(Status::ill_defined, cut_locus_reason);
  result.estimate = Gaussian<G>{result.mean.mean, withWidenedAngles<G>(settled.covariance, result.region_factor)};
  result.status = Status::ok;
  return result;
}

}  // namespace detail

/// The exponential barycentre of a range of group elements, weighted or not, certified by the mean of its metric twin,
/// with its covariance from the residuals if that can be trusted: status ok. The result has the same bits on any
/// executor.
template <Executor E, detail::AnyRange R, class G = detail::GroupInSignature<R>>
CertifiedGroupMean<G> certifiedGroupMean(const E& executor, R&& samples,
                                         const CertifiedGroupMeanOptions& options = {}) {
  if constexpr (detail::RequireGroupMean<R>::ok) {
    const auto elements = detail::asSamples(samples);
    return detail::findCertifiedGroupMean<G>(detail::erased(executor), elements, detail::ones(elements.size()),
                                             options);
  } else {
    return {};
  }
}
template <detail::AnyRange R, class G = detail::GroupInSignature<R>>
CertifiedGroupMean<G> certifiedGroupMean(R&& samples, const CertifiedGroupMeanOptions& options = {}) {
  return certifiedGroupMean(SerialExecutor{}, samples, options);
}
template <Executor E, detail::AnyRange R, detail::AnyRange W, class G = detail::GroupInSignature<R>>
CertifiedGroupMean<G> certifiedGroupMean(const E& executor, R&& samples, W&& weights,
                                         const CertifiedGroupMeanOptions& options = {}) {
  if constexpr (detail::RequireGroupMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<G>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows&) {
          return detail::findCertifiedGroupMean<G>(detail::erased(executor), features, numbers, options);
        },
        [] { return detail::without<CertifiedGroupMean<G>>(Status::not_applicable, detail::bad_weights_reason); });
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class G = detail::GroupInSignature<R>>
CertifiedGroupMean<G> certifiedGroupMean(R&& samples, W&& weights, const CertifiedGroupMeanOptions& options = {}) {
  return certifiedGroupMean(SerialExecutor{}, samples, weights, options);
}

}  // namespace liestat

#ifdef LIESTAT_COMPILED_MEANS
#include <stats/detail/compiled_certified_group_mean.hpp>
#endif
