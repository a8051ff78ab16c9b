// maha: the feature of least sum of squared Mahalanobis distances to measurements that each have their covariance, and
// fuse. Pennec 1998, section 4.2, with the exact gradient and Hessian (docs/theory/means.md, section 4; the report's
// printed ones are in stats/printed.hpp).
//
// Two models that coincide on points, rotations and every group, and differ on frames:
//   CovarianceAt::measured   S_i lives in the frame of measurement x_i (a sensor's): w = log(x_i, y), μ² = wᵀ S_i⁻¹ w
//   CovarianceAt::estimated  V_i lives in the frame of the estimate (an object's): z = log(y, x_i), μ² = zᵀ V_i⁻¹ z;
//                            the noise x_i = exp(x, e_i), Cov(e_i) = V_i, of the report's experiments
// Feeding noise of one model to the other gives a wrong answer, not a rough one: the caller says which it is.
#pragma once

#include <lie/manifold.hpp>
#include <stats/detail/any_executor.hpp>
#include <stats/detail/mahalanobis_mean.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/settled_maha.hpp>
#include <stats/executor.hpp>
#include <stats/factored_gaussian.hpp>
#include <stats/gaussian.hpp>
#include <stats/maha_types.hpp>
#include <stats/mean.hpp>
#include <stats/noise_fit.hpp>
#include <stats/start.hpp>
#include <stats/status.hpp>

#include <concepts>
#include <limits>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace liestat {

namespace detail {

/// The manifold of a range of features with covariances; for other ranges something that compiles, and RequireGaussians
/// says what is wrong.
template <class>
struct FeatureOfGaussian {
  using type = SO3<double>;
};
template <class M>
struct FeatureOfGaussian<Gaussian<M>> {
  using type = M;
};
template <class M>
struct FeatureOfGaussian<FactoredGaussian<M>> {
  using type = M;
};
template <AnyRange R>
using FeatureInSignature = typename FeatureOfGaussian<ElementOf<R>>::type;

/// States in one sentence why a range has no Mahalanobis mean; `ok` where it has one. `ModelGiven`: the caller said in
/// which frame the covariances are.
template <AnyRange R, bool ModelGiven = true>
struct RequireGaussians {
  using M = FeatureInSignature<R>;
  static constexpr bool factored = std::same_as<ElementOf<R>, FactoredGaussian<M>>;
  static constexpr bool gaussians = std::same_as<ElementOf<R>, Gaussian<M>> || factored;
  static constexpr bool one_model = requires { requires ManifoldTraits<M>::covariance_models_coincide; };
  static constexpr bool ok = MultiPass<R> && gaussians && (ModelGiven || one_model);
  static_assert(MultiPass<R>, "liestat: the data can be gone through only once; copy them into a std::vector first.");
  static_assert(gaussians,
                "liestat: maha and fuse take a range of liestat::Gaussian, features with their covariance, or of "
                "liestat::FactoredGaussian.");
  static_assert(ModelGiven || one_model,
                "liestat: on this manifold the frame of the covariances matters: say CovarianceAt::measured (a "
                "sensor's, in the frame of the measurement) or CovarianceAt::estimated (an object's, in the frame of "
                "the estimate).");
};

/// Features with the factors of their covariances, as the estimators take them.
template <Homogeneous M>
struct FactoredSamples {
  std::vector<SquareOf<M>> factors;
  Samples<Gaussian<M>> gaussians;

  template <class R>
  explicit FactoredSamples(const R& samples) : gaussians(listOf(samples)) {
    for (const FactoredGaussian<M>& x : samples) factors.push_back(x.factor);
  }

 private:
  template <class R>
  static std::vector<Gaussian<M>> listOf(const R& samples) {
    std::vector<Gaussian<M>> list;
    for (const FactoredGaussian<M>& x : samples) list.push_back(x.gaussian());
    return list;
  }
};

}  // namespace detail

/// Squared Mahalanobis distance of a measurement from a mean; `at` is the frame of its covariance.
template <Homogeneous M>
ScalarOf<M> mahalanobisSquared(const Gaussian<M>& measurement, const M& mean, CovarianceAt at) {
  const TangentOf<M> z = at == CovarianceAt::measured ? log(measurement.mean, mean) : log(mean, measurement.mean);
  return mahalanobisSquared<ScalarOf<M>, ManifoldTraits<M>::DoF>(z, measurement.covariance);
}

namespace detail {

/// The χ² of measurements about their Mahalanobis mean: twice its cost, but for what the likelihood adds to that.
template <Homogeneous M, class R>
NoiseFit fitOfMaha(const R& samples, const MahaResult<M>& result, CovarianceAt at, bool likelihood) {
  double chi2 = likelihood ? 0 : 2 * static_cast<double>(result.cost);
  if (likelihood) {
    for (const Gaussian<M>& g : samples) chi2 += static_cast<double>(mahalanobisSquared(g, result.mean, at));
  }
  return NoiseFit::of(chi2, ManifoldTraits<M>::DoF * (static_cast<double>(std::ranges::size(samples)) - 1));
}

/// A Mahalanobis mean with the test of its covariances.
template <Homogeneous M, Executor E, class R>
MahaResult<M> testedMaha(const E& executor, const R& samples, CovarianceAt at, const MahaOptions<M>& options,
                         std::span<const SquareOf<M>> factors) {
  MahaResult<M> result = mahalanobisMean<M>(executor, samples, at, options, factors);
  if (result.status != Status::ok) return result;
  result.fit = fitOfMaha<M>(samples, result, at, options.likelihood);
  if (result.fit.refuted(options.refutation_level)) result.status = Status::inconsistent;
  return result;
}

}  // namespace detail

/// Mahalanobis mean of a range of Gaussian<M> or FactoredGaussian<M>. Status inconsistent, with the covariance that the
/// refuted ones give, if the measurements scatter more than they say; ill_defined if a covariance is not positive
/// definite, too_few for an empty range, not_converged if the data are not finite, not_applicable for
/// CovarianceAt::estimated with an anisotropic covariance on a manifold without a continuous placement (directions) and
/// for likelihood where a user's manifold has no logVolume.
template <Executor E, detail::AnyRange R, class M = detail::FeatureInSignature<R>>
MahaResult<M> maha(const E& executor, R&& samples, CovarianceAt at,
                   const MahaOptions<std::type_identity_t<M>>& options = {}) {
  if constexpr (detail::RequireGaussians<R>::ok && detail::RequireGaussians<R>::factored) {
    const detail::FactoredSamples<M> both(samples);
    return detail::testedMaha<M>(detail::erased(executor), both.gaussians, at, options, both.factors);
  } else if constexpr (detail::RequireGaussians<R>::ok) {
    return detail::testedMaha<M>(detail::erased(executor), detail::asValues<Gaussian<M>>(samples), at, options, {});
  } else {
    return {};
  }
}
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
MahaResult<M> maha(R&& samples, CovarianceAt at, const MahaOptions<std::type_identity_t<M>>& options = {}) {
  return maha(SerialExecutor{}, samples, at, options);
}
/// The same where both models coincide (points, rotations, groups); elsewhere it does not compile.
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
MahaResult<M> maha(R&& samples, const MahaOptions<std::type_identity_t<M>>& options = {}) {
  if constexpr (detail::RequireGaussians<R, false>::ok) {
    return maha(SerialExecutor{}, samples, CovarianceAt::measured, options);
  } else {
    return {};
  }
}

/// The result of testedFuse().
template <Homogeneous M>
struct FuseResult {
  /// The mean with its covariance. NaN where there is no trustworthy one; where the fit refutes it (inconsistent) it is
  /// still that of the stated covariances, which fit.factor() widens.
  Gaussian<M> estimate;
  /// A factor of the covariance, as in MahaResult.
  SquareOf<M> factor = SquareOf<M>::Constant(std::numeric_limits<ScalarOf<M>>::quiet_NaN());
  /// ok, inconsistent; ill_defined where the features are as scattered as uniform ones or the criterion is flat where
  /// the truth may be; else the status of maha().
  Status status = Status::too_few;
  NoiseFit fit;

  /// Makes covariance and factor NaN.
  void withhold() {
    estimate.covariance.setConstant(std::numeric_limits<ScalarOf<M>>::quiet_NaN());
    factor = estimate.covariance;
  }
};

namespace detail {

template <Homogeneous M, class R>
FuseResult<M> fused(const R& samples, CovarianceAt at, std::span<const SquareOf<M>> factors) {
  const SerialExecutor serial;
  const AnyExecutor executor(serial);
  const MahaResult<M> found = testedMaha<M>(executor, samples, at, {}, factors);
  FuseResult<M> result{found.estimate(), found.factor, found.status, found.fit};
  if (!converged(found.status) || found.status == Status::ill_defined) return result;
  const SettledMaha<M> settled = settleMaha<M>(executor, samples, at, false, found, largest_hessian_change, factors);
  if (settled.settled && showAMean<M>(samples, found.mean)) {
    result.estimate.covariance = settled.covariance;
    result.factor = settled.factor;
  } else {
    result.withhold();
    result.status = Status::ill_defined;
  }
  return result;
}

/// The result of fuse(): a Gaussian for a range of Gaussians, a factored one for factored ones.
template <AnyRange R, class M>
using FusedOf = std::conditional_t<RequireGaussians<R>::factored, FactoredGaussian<M>, Gaussian<M>>;

}  // namespace detail

/// A range of Gaussians to one: the mean of maha() with its covariance, the Hessian averaged over the confidence region
/// as certifiedMaha (stats/certified_maha.hpp) does, and the test of their fit. Other minima are not looked for.
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
FuseResult<M> testedFuse(R&& samples, CovarianceAt at) {
  if constexpr (detail::RequireGaussians<R>::ok && detail::RequireGaussians<R>::factored) {
    const detail::FactoredSamples<M> both(samples);
    return detail::fused<M>(both.gaussians, at, both.factors);
  } else if constexpr (detail::RequireGaussians<R>::ok) {
    return detail::fused<M>(detail::asValues<Gaussian<M>>(samples), at, {});
  } else {
    return {};
  }
}
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
FuseResult<M> testedFuse(R&& samples) {
  if constexpr (detail::RequireGaussians<R, false>::ok) {
    return testedFuse(samples, CovarianceAt::measured);
  } else {
    return {};
  }
}

/// The estimate of testedFuse() alone; factored Gaussians give a factored one. The covariance is NaN unless its status
/// is ok: where the Gaussians lie farther apart than their covariances say, directions or rotations are as scattered as
/// uniform ones, or the criterion is flat where the truth may be.
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
detail::FusedOf<R, M> fuse(R&& samples, CovarianceAt at) {
  FuseResult<M> result = testedFuse(samples, at);
  if (result.status == Status::inconsistent) result.withhold();
  if constexpr (detail::RequireGaussians<R>::factored) {
    return {result.estimate.mean, result.factor};
  } else {
    return result.estimate;
  }
}
template <detail::AnyRange R, class M = detail::FeatureInSignature<R>>
detail::FusedOf<R, M> fuse(R&& samples) {
  if constexpr (detail::RequireGaussians<R, false>::ok) {
    return fuse(samples, CovarianceAt::measured);
  } else {
    return {};
  }
}

}  // namespace liestat

#ifdef LIESTAT_COMPILED_MEANS
#include <stats/detail/compiled_maha.hpp>
#endif
