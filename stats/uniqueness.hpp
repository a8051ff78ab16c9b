// Is the mean the only one? Certificates for a Fréchet mean, cheap ones first, then a certified global search. A mean
// with its covariance and all that is known about it is certifiedMean (stats/certified_mean.hpp).
//
// A Fréchet mean minimises C(y) = ½ Σ p_i d²(y, x_i), which may have several minima on a compact manifold. The
// certificates (docs/theory/means.md, section 5.2; the criterion separates, so of a frame only the rotation matters):
//   a priori    the data lie in a ball of radius r < ½ min(injectivity radius, π/√Δ), Δ the largest sectional curvature:
//               the mean is unique (Kendall 1990, Afsari 2011). Rotations, directions: π/2, quotient frames: π/4
//   local       C is strictly convex along every geodesic of length r* from the mean; and every y with C(y) ≤ C(mean)
//               is within 2 Σp_i θ_i / Σp_i, by the triangle inequality. Where the first radius exceeds the second:
//               unique
//   circle      SO(2), Frame2, RxSO2: all minima by sorting, exact
//   global      branch and bound on SO(3), its quotients and S² (stats/detail/branch_and_bound.hpp)
//   factors     of a product each factor's minimum is certified by itself
// The first two are tried with what the passes for the mean have seen, before the data are looked at again.
// Which of them serve a manifold is said by its traits (compact_factor, factors; lie/concepts.hpp); the first needs
// distances alone. Needs Eigen alone. Data never throws: what is not finite is not_certified.
#pragma once

#include <stats/detail/find_uniqueness.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/any_executor.hpp>
#include <stats/detail/weights.hpp>
#include <stats/executor.hpp>
#include <stats/mean.hpp>
#include <stats/uniqueness_types.hpp>

#include <type_traits>

namespace liestat {

/// r*: the largest radius (rad) about a mean in which the criterion is strictly convex along every geodesic from it, so
/// that the mean is the only minimum there: θ_i + r < π (quotients: 2r < gap_i) for all data and Σ p_i g(θ_i + r) > 0,
/// g the transverse eigenvalue of Hess ½d². 0 if there is none.
template <detail::AnyRange R, class M = detail::MetricInSignature<R>>
double localRadius(R&& samples, const std::type_identity_t<M>& mean) {
  if constexpr (detail::RequireMean<R>::ok) {
    return detail::findLocalRadius(detail::asSamples(samples), detail::UnitWeights{}, mean);
  } else {
    return 0;
  }
}
template <detail::AnyRange R, detail::AnyRange W, class M = detail::MetricInSignature<R>>
double localRadius(R&& samples, W&& weights, const std::type_identity_t<M>& mean) {
  if constexpr (detail::RequireMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<M>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows&) {
          return detail::findLocalRadius(features, numbers, mean);
        },
        [] { return 0.0; });
  } else {
    return 0;
  }
}

/// Is the mean of these features the only one? `mean` is what mean() returned for the same features and weights.
/// If a lower minimum turns up it is returned: this is a certified global search. The same bits on any executor.
template <Executor E, detail::AnyRange R, class M = detail::MetricInSignature<R>>
UniquenessResult<M> uniqueness(const E& executor, R&& samples, const MeanResult<std::type_identity_t<M>>& mean,
                               const UniquenessOptions& options = {}) {
  if constexpr (detail::RequireMean<R>::ok) {
    const auto features = detail::asSamples(samples);
    return detail::findUniqueness(detail::erased(executor), features, detail::ones(features.size()), mean, options);
  } else {
    return {};
  }
}
template <detail::AnyRange R, class M = detail::MetricInSignature<R>>
UniquenessResult<M> uniqueness(R&& samples, const MeanResult<std::type_identity_t<M>>& mean,
                               const UniquenessOptions& options = {}) {
  return uniqueness(SerialExecutor{}, samples, mean, options);
}
template <Executor E, detail::AnyRange R, detail::AnyRange W, class M = detail::MetricInSignature<R>>
UniquenessResult<M> uniqueness(const E& executor, R&& samples, W&& weights,
                               const MeanResult<std::type_identity_t<M>>& mean, const UniquenessOptions& options = {}) {
  if constexpr (detail::RequireMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<M>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows&) {
          return detail::findUniqueness(detail::erased(executor), features, numbers, mean, options);
        },
        [&] {
          UniquenessResult<M> nothing;
          nothing.minimiser = mean.mean;
          return nothing;
        });
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class M = detail::MetricInSignature<R>>
UniquenessResult<M> uniqueness(R&& samples, W&& weights, const MeanResult<std::type_identity_t<M>>& mean,
                               const UniquenessOptions& options = {}) {
  return uniqueness(SerialExecutor{}, samples, weights, mean, options);
}

}  // namespace liestat
