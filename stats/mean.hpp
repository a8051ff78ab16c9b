// mean: the Fréchet mean of features, LSQ and WLSQ of Pennec 1998, sections 3 and 4.1.
//
// Criterion C(y) = ½ Σ p_i d²(y, x_i), with Newton's method on the exact Hessian Σ p_i Hess ½d² under a monotone
// safeguard, or the report's fixed point y ← f_y⋆(Σ p_i z_i / Σ p_i), eq. (4). Needs Eigen alone.
#pragma once

#include <lie/detail/always_inline.hpp>
#include <lie/manifold.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/detail/any_executor.hpp>
#include <stats/detail/mean_pass.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/weights.hpp>
#include <stats/executor.hpp>
#include <stats/start.hpp>
#include <stats/status.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <optional>
#include <ranges>
#include <type_traits>
#include <vector>

namespace liestat {

enum class MeanMethod {
  newton,      ///< exact Hessian; takes a step of eq. (4) if Newton's step does not decrease the criterion enough
  fixed_point  ///< eq. (4) of the report: monotone from any start, linear convergence
};

/// Options of mean().
template <Homogeneous M>
struct MeanOptions {
  MeanMethod method = MeanMethod::newton;
  /// The iteration stops when the intrinsic norm of a step (rad, m) falls below this; unset: max(1e-12, 4 eps (scale of
  /// the data)), where the scale includes the magnitude of the coordinates, so that float and map coordinates converge.
  std::optional<double> tolerance = {};
  int max_iterations = 100;
  /// The initial value; unset: the chordal mean, or for quotients the best of several measurements. It is never simply
  /// the first measurement.
  std::optional<M> start = {};
};

/// Result of mean(). Matrices are in the local frame at the mean; the sums are those of the last pass over the data, at
/// a point within the tolerance of the mean.
template <Homogeneous M>
struct MeanResult {
  M mean = ManifoldTraits<M>::origin();
  Status status = Status::too_few;
  int iterations = 0;    ///< steps taken, the last one below the tolerance
  double residual = 0;   ///< intrinsic norm of the last step
  double tolerance = 0;  ///< the tolerance used
  std::size_t n = 0;
  double sum_of_weights = 0;
  ScalarOf<M> cost = 0;                                      ///< C = ½ Σ p_i d²
  SquareOf<M> hessian = SquareOf<M>::Zero();                 ///< Σ p_i Hess ½d²(·, x_i)
  SquareOf<M> scatter = SquareOf<M>::Zero();                 ///< Σ p_i z_i z_iᵀ
  SquareOf<M> squared_weight_scatter = SquareOf<M>::Zero();  ///< Σ p_i² z_i z_iᵀ
  ScalarOf<M> largest_distance = 0;                          ///< max d(mean, x_i)
  ScalarOf<M> smallest_gap =  ///< for a quotient: smallest angular distance to the cut locus
      std::numeric_limits<ScalarOf<M>>::infinity();
  /// The angles θ_i of rotations, directions and the like from the mean, of frames those of the rotations alone: the
  /// largest, rad, and Σ p_i θ_i⁴. Zero if the traits of M name no compact factor.
  ScalarOf<M> largest_angle = 0;
  double angle_fourth_moment = 0;

  /// Σ p_i z_i z_iᵀ / Σ p_i: the dispersion of the features about their mean.
  SquareOf<M> dispersion() const { return scatter / ScalarOf<M>(sum_of_weights); }
};

namespace detail {

/// Magnitude of the features' coordinates at y and of the spread, to which rounding errors are proportional; of a
/// compact space in double a bound, whose errors are far below any tolerance.
template <Metric M>
double dataScale(const M& y, const MeanSums<M>& sums) {
  if constexpr (std::is_same_v<ScalarOf<M>, double> && has_compact_factor<M>) {
    if constexpr (compact_dimension<M> == ManifoldTraits<M>::DoF) return 1 + 2 * std::numbers::pi;
  }
  const double spread = sums.weight > 0 ? std::sqrt(2 * static_cast<double>(sums.cost) / sums.weight) : 0;
  return 1 + spread + static_cast<double>(ManifoldTraits<M>::logOrigin(y).norm());
}

template <class S>
double automaticTolerance(double scale) {
  return std::max(1e-12, 4 * static_cast<double>(std::numeric_limits<S>::epsilon()) * scale);
}

template <Metric M, Executor E, class R, class W>
MeanResult<M> frechetMean(const E& executor, const R& samples, const W& weights, const MeanOptions<M>& options);

/// The mean of the rotations by which orientations modulo a group (CrystalOrientation) are nearest to y: a start from
/// which most means need no step more, by the kernels of rotations.
template <class M, Executor E, class R, class W>
M meanOfCopies(const E& executor, const R& samples, const W& weights, const M& y) {
  using Rotation = typename ManifoldTraits<M>::Group;
  const std::size_t n = std::ranges::size(samples), chunks = chunkCount(n);
  std::vector<Rotation> copies(n);
  executor.reduce(
      chunks,
      [&](std::size_t chunk) {
        const ChunkRange range = chunkRange(n, chunks, chunk);
        for (std::size_t i = range.begin; i < range.end; ++i) copies[i] = M(samples[i]).nearestTo(y.rotation());
        return 0;
      },
      [](int&, int) {});
  const auto found = frechetMean<Rotation>(executor, asSamples(copies), weights, MeanOptions<Rotation>{});
  // The copy of least rotation, whatever copies the data are.
  const M mean = converged(found.status) ? M(found.mean, y.group()) : y;
  return {mean.nearestTo(Rotation()), y.group()};
}

/// Never inlined: a program has one of it, and its results the same bits, whatever flags its units have.
template <Metric M, Executor E, class R, class W>
LIESTAT_NO_INLINE MeanResult<M> frechetMean(const E& executor, const R& samples, const W& weights,
                                            const MeanOptions<M>& options) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  const std::size_t n = std::ranges::size(samples);
  if (n == 0) return {};

  const TangentOf<M> metric = T::metricWeights();
  // Number by number, as v has been stored: a register of them would wait.
  const auto norm = [&](const TangentOf<M>& v) {
    using std::sqrt;
    S sum(0);
    for (int i = 0; i < T::DoF; ++i) sum += metric[i] * v[i] * v[i];
    return static_cast<double>(sqrt(sum));
  };
  Status status = Status::not_converged;
  int iterations = 0;
  double residual = 0, previous_residual = std::numeric_limits<double>::infinity();
  std::optional<double> tolerance = options.tolerance;
  M y = options.start ? *options.start : startOfMean<M>(executor, samples, weights);
  // In a flat space the start is the mean already.
  bool with_scatter = !options.start && starts_at_mean<M>;
  if constexpr (requires { y.group(); }) {
    if (!options.start) y = meanOfCopies(executor, samples, weights, y), with_scatter = true;
  }
  // If the last step was Newton's: where it began, the step of eq. (4) from there times the weights, and the cost that
  // it may reach.
  bool newton = false;
  M before = y;
  TangentOf<M> weighted_step;
  S most(0);
  // Each pass is made where it stays: to copy its sums costs as much as those of ten features.
  for (;;) {
    const MeanPass<M> pass = meanPass(executor, samples, weights, y, with_scatter);
    const MeanSums<M>& sums = pass.sums;
    if (newton && !(sums.cost <= most)) {
      y = exp(before, TangentOf<M>(weighted_step / S(sums.weight)));
      newton = with_scatter = false;
      continue;
    }
    if (!tolerance) tolerance = automaticTolerance<S>(dataScale(y, sums));

    M next = y;
    bool last = iterations >= options.max_iterations;
    if (!last) {
      TangentOf<M> step;
      newton = options.method == MeanMethod::newton && solveStep(sums.hessian, sums.gradient, step);
      if (newton) {
        residual = norm(step);
        // Outside the injectivity radius a Newton step has lost its meaning.
        newton = std::isfinite(residual) && residual < static_cast<double>(injectivityRadiusAt(y));
      }
      if (!newton) {
        step = sums.gradient.cwiseQuotient(metric) / S(sums.weight);
        residual = norm(step);
      }
      last = !std::isfinite(residual) || !std::isfinite(static_cast<double>(sums.cost));
      if (!last) {
        ++iterations;
        next = exp(y, step);
        last = residual <= *tolerance;
        if (last) status = Status::ok;
      }
    }
    if (last) {
      // After a step below the tolerance the sums remain those of the point before, which is the mean to the tolerance:
      // no pass over the data for that.
      const auto resultWith = [&](const MeanPass<M>& p) -> MeanResult<M> {
        return {next,
                status,
                iterations,
                residual,
                *tolerance,
                n,
                p.sums.weight,
                p.sums.cost,
                p.sums.hessian,
                p.scatter.scatter,
                p.scatter.squared,
                p.scatter.largest,
                p.scatter.smallest_gap,
                p.scatter.largest_angle,
                p.scatter.fourth};
      };
      return pass.has_scatter ? resultWith(pass) : resultWith(meanPass<true>(executor, samples, weights, next));
    }

    // The next step's length: the square of this one by Newton's method (a small multiple of it: clouds are nearly
    // symmetric), the same fraction of it as it is of the previous one by eq. (4).
    const double expected = newton ? 1e-4 * residual * residual : residual * (residual / previous_residual);
    with_scatter = expected <= *tolerance;
    previous_residual = residual;
    if (newton) {
      // Eq. (4) decreases C by at least ½ Σp |δ|²; Newton's step is kept if it does as well, up to rounding.
      weighted_step = sums.gradient.cwiseQuotient(metric);
      const S guaranteed = S(0.5) * weighted_step.dot(sums.gradient) / S(sums.weight);
      const S rounding = S(8) * std::numeric_limits<S>::epsilon() * sums.cost;
      most = sums.cost - guaranteed + rounding;
      before = y;
    }
    y = next;
  }
}

/// States in one sentence why a range of features has no Fréchet mean; `ok` if it has one.
template <AnyRange R>
struct RequireMean : RequireSamples<R> {
  static constexpr bool ok = RequireSamples<R>::ok && Metric<SampleInSignature<R>>;
  static_assert(
      Metric<SampleInSignature<R>>,
      "the Frechet mean needs an invariant Riemannian metric; this type has none. Use Frame3 or Frame2 for poses, or "
      "groupMean (the exponential barycentre) or maha.");
};
template <class R>
using MetricInSignature = std::conditional_t<Metric<SampleInSignature<R>>, SampleInSignature<R>, SO3<double>>;

}  // namespace detail

/// Fréchet mean of a range of features (LSQ), for manifolds with an invariant metric; for groups without one, such as
/// SE3, there are groupMean and maha. Without features the status is too_few, with features that are not finite
/// not_converged.
///
/// The features are any range that can be traversed more than once, of points or of types that represent them: views
/// (Eigen::Map<const SO3d>), columns (Matrix3Xd::colwise()), unit quaternions. The result is of the owning type. Values
/// in random-access memory are used in place, others are copied once.
template <Executor E, detail::AnyRange R>
MeanResult<detail::SampleInSignature<R>> mean(const E& executor, R&& samples,
                                              const MeanOptions<detail::SampleInSignature<R>>& options = {}) {
  if constexpr (detail::RequireMean<R>::ok) {
    return detail::frechetMean<SampleOf<R>>(detail::erased(executor), detail::asSamples(samples), detail::UnitWeights{},
                                            options);
  } else {
    return {};
  }
}
template <detail::AnyRange R>
MeanResult<detail::SampleInSignature<R>> mean(R&& samples,
                                              const MeanOptions<detail::SampleInSignature<R>>& options = {}) {
  return mean(SerialExecutor{}, samples, options);
}

/// Weighted Fréchet mean (WLSQ): minimises ½ Σ p_i d²(y, x_i). Weights are relative, one for each feature, in any range
/// of numbers (std::vector, Eigen::VectorXd …); stats/covariance.hpp describes their meaning for the covariance. A
/// feature of weight zero is omitted, and n counts the others. The status is not_applicable if a weight is negative or
/// not finite, or none is positive. If the largest is beyond 2^±30 all are first multiplied by a power of two, which
/// the sums of the result include.
template <Executor E, detail::AnyRange R, detail::AnyRange W>
MeanResult<detail::SampleInSignature<R>> mean(const E& executor, R&& samples, W&& weights,
                                              const MeanOptions<detail::SampleInSignature<R>>& options = {}) {
  if constexpr (detail::RequireMean<R>::ok && detail::RequireWeights<W>::ok) {
    using M = SampleOf<R>;
    return detail::withRelativeWeights<M>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows&) {
          return detail::frechetMean<M>(detail::erased(executor), features, numbers, options);
        },
        [] { return detail::without<MeanResult<M>>(Status::not_applicable); });
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W>
MeanResult<detail::SampleInSignature<R>> mean(R&& samples, W&& weights,
                                              const MeanOptions<detail::SampleInSignature<R>>& options = {}) {
  return mean(SerialExecutor{}, samples, weights, options);
}

}  // namespace liestat

#ifdef LIESTAT_COMPILED_MEANS
#include <stats/detail/compiled_mean.hpp>
#endif
