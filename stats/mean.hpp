// mean: the Fréchet mean of features, LSQ and WLSQ of Pennec 1998, sections 3 and 4.1.
//
// Criterion C(y) = ½ Σ p_i d²(y, x_i), with Newton's method on the exact Hessian Σ p_i Hess ½d² under a monotone
// safeguard, or the report's fixed point y ← f_y⋆(Σ p_i z_i / Σ p_i), eq. (4). Needs Eigen alone.
#pragma once

#include <lie/manifold.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/detail/packing.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/rotation_sums.hpp>
#include <stats/executor.hpp>
#include <stats/start.hpp>
#include <stats/status.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <ranges>
#include <span>
#include <type_traits>
#include <vector>

namespace liestat {

enum class MeanMethod {
  newton,      ///< exact Hessian; falls back on a step of eq. (4) that decreases the criterion where Newton's does not
  fixed_point  ///< eq. (4) of the report: monotone from any start, linear convergence
};

/// Options of mean().
template <Homogeneous M>
struct MeanOptions {
  MeanMethod method = MeanMethod::newton;
  /// Stop when a step's intrinsic norm (rad, m) falls below; unset: max(1e-12, 4 eps (scale of the data)), where the
  /// scale counts the coordinates' size too, so that float and map coordinates converge.
  std::optional<double> tolerance = {};
  int max_iterations = 100;
  /// Where to start; unset: the chordal mean, or for quotients the best of several data. Never simply the first
  /// measurement.
  std::optional<M> start = {};
};

/// What mean() returns. Matrices are in the local frame at the mean; the sums are those of the last pass over the data,
/// at a point within the tolerance of the mean.
template <Homogeneous M>
struct MeanResult {
  M mean = ManifoldTraits<M>::origin();
  Status status = Status::too_few;
  int iterations = 0;    ///< steps taken, the last one below the tolerance
  double residual = 0;   ///< intrinsic norm of the last step
  double tolerance = 0;  ///< the one that was used
  std::size_t n = 0;
  double sum_of_weights = 0;
  ScalarOf<M> cost = 0;                                      ///< C = ½ Σ p_i d²
  SquareOf<M> hessian = SquareOf<M>::Zero();                 ///< Σ p_i Hess ½d²(·, x_i)
  SquareOf<M> scatter = SquareOf<M>::Zero();                 ///< Σ p_i z_i z_iᵀ
  SquareOf<M> squared_weight_scatter = SquareOf<M>::Zero();  ///< Σ p_i² z_i z_iᵀ
  ScalarOf<M> largest_distance = 0;                          ///< max d(mean, x_i)
  ScalarOf<M> smallest_gap =  ///< of a quotient: least distance in angle to the cut locus
      std::numeric_limits<ScalarOf<M>>::infinity();

  /// Σ p_i z_i z_iᵀ / Σ p_i: how the data spread about their mean.
  SquareOf<M> dispersion() const { return scatter / ScalarOf<M>(sum_of_weights); }
};

namespace detail {

/// Stands for weights that are all one.
struct UnitWeights {
  double operator[](std::size_t) const { return 1; }
};

/// Whether there is a weight for every datum.
template <class R, class W>
bool haveOneSize(const R& samples, const W& weights) {
  if constexpr (std::is_same_v<W, UnitWeights>) {
    return true;
  } else {
    return std::ranges::size(samples) == std::ranges::size(weights);
  }
}

/// What one pass over the data returns at a candidate mean.
template <Homogeneous M>
struct MeanSums {
  ScalarOf<M> cost = 0;
  TangentOf<M> gradient = TangentOf<M>::Zero();  ///< Σ p_i W z_i, minus the gradient of C
  SquareOf<M> hessian = SquareOf<M>::Zero();
  double weight = 0;

  void operator+=(const MeanSums& other) {
    cost += other.cost;
    gradient += other.gradient;
    hessian += other.hessian;
    weight += other.weight;
  }
};

/// Further sums that the covariances need, at the mean.
template <Homogeneous M>
struct ScatterSums {
  SquareOf<M> scatter = SquareOf<M>::Zero(), squared = SquareOf<M>::Zero();
  ScalarOf<M> largest = 0, smallest_gap = std::numeric_limits<ScalarOf<M>>::infinity();

  void operator+=(const ScatterSums& other) {
    scatter += other.scatter;
    squared += other.squared;
    largest = std::max(largest, other.largest);
    smallest_gap = std::min(smallest_gap, other.smallest_gap);
  }
};

/// Σ over the data in fixed chunks combined in order: same bits on any executor.
template <class Sums, Executor E, class Term>
Sums sumOverData(const E& executor, std::size_t n, const Term& term) {
  const std::size_t chunks = chunkCount(n);
  return executor.reduce(
      chunks,
      [&](std::size_t chunk) {
        Sums sums;
        const ChunkRange range = chunkRange(n, chunks, chunk);
        for (std::size_t i = range.begin; i < range.end; ++i) term(i, sums);
        return sums;
      },
      [](Sums& a, const Sums& b) { a += b; });
}

/// What one pass over the data collects; the scatter only where it is asked for.
template <Homogeneous M>
struct MeanPass {
  MeanSums<M> sums;
  ScatterSums<M> scatter;
  bool has_scatter = false;

  void operator+=(const MeanPass& other) {
    sums += other.sums;
    scatter += other.scatter;
  }
  std::vector<double> pack() const {
    return packed(sums.cost, sums.gradient, sums.hessian, sums.weight, scatter.scatter, scatter.squared,
                  scatter.largest, scatter.smallest_gap);
  }
  static MeanPass unpack(std::span<const double> list) {
    MeanPass p;
    unpackInto(list, p.sums.cost, p.sums.gradient, p.sums.hessian, p.sums.weight, p.scatter.scatter, p.scatter.squared,
               p.scatter.largest, p.scatter.smallest_gap);
    return p;
  }
};

/// The terms of the features in a range of indices, by the manifold's own operations.
template <bool Scatter, Metric M, class R, class W>
void addTerms(const R& samples, const W& weights, const M& y, const ChunkRange& range, MeanPass<M>& pass) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  using std::sqrt;
  constexpr bool weighted = !std::is_same_v<W, UnitWeights>;
  const typename T::Group to_mean = T::placement(y).inverse();
  const TangentOf<M> metric = T::metricWeights();
  for (std::size_t i = range.begin; i < range.end; ++i) {
    const S p = S(weights[i]);
    const M at_mean = T::act(to_mean, M(samples[i]));
    const TangentOf<M> z = T::logOrigin(at_mean);
    const TangentOf<M> wz = metric.cwiseProduct(z);
    const S squared_distance = z.dot(wz);
    pass.sums.cost += S(0.5) * p * squared_distance;
    pass.sums.gradient += p * wz;
    pass.sums.hessian += p * T::hessianHalfSquaredDistance(z);
    pass.sums.weight += weights[i];
    if constexpr (Scatter) {
      const SquareOf<M> outer = p * z * z.transpose();
      pass.scatter.scatter += outer;
      if constexpr (weighted) pass.scatter.squared += p * outer;
      pass.scatter.largest = std::max(pass.scatter.largest, S(sqrt(squared_distance)));
      if constexpr (Quotient<M>) {
        pass.scatter.smallest_gap = std::min(pass.scatter.smallest_gap, T::nearestRepresentative(at_mean).gap());
      }
    }
  }
  if constexpr (Scatter && !weighted) pass.scatter.squared = pass.scatter.scatter;
}

/// The same several features at a time, for the manifolds that have it; false where that does not apply to the data.
template <bool Scatter, Metric M, class R, class W>
bool addTermsByPacks(const R& samples, const W& weights, const M& y, const ChunkRange& range, MeanPass<M>& pass) {
  if constexpr (HasRotationSums<M>) {
    RotationSums<M> sums;
    constexpr bool weighted = !std::is_same_v<W, UnitWeights>;
    if (!sums.template add<weighted, Scatter>(samples, weights, range.begin, range.end, y)) return false;
    pass.sums = {sums.cost, sums.gradient, sums.hessian, sums.weight};
    if constexpr (Scatter) pass.scatter = {sums.scatter, sums.squared, sums.largest, sums.smallest_gap};
    return true;
  } else {
    return false;
  }
}

template <bool Scatter, Metric M, Executor E, class R, class W>
MeanPass<M> meanPass(const E& executor, const R& samples, const W& weights, const M& y) {
  const std::size_t n = std::ranges::size(samples), chunks = chunkCount(n);
  MeanPass<M> pass = executor.reduce(
      chunks,
      [&](std::size_t chunk) {
        MeanPass<M> part;
        const ChunkRange range = chunkRange(n, chunks, chunk);
        if (!addTermsByPacks<Scatter>(samples, weights, y, range, part)) {
          addTerms<Scatter>(samples, weights, y, range, part);
        }
        return part;
      },
      [](MeanPass<M>& a, const MeanPass<M>& b) { a += b; });
  pass.has_scatter = Scatter;
  return pass;
}

/// One pass at a candidate mean. The one that is expected to be the last collects the scatter too.
template <Metric M, Executor E, class R, class W>
MeanPass<M> meanPass(const E& executor, const R& samples, const W& weights, const M& y, bool with_scatter) {
  return with_scatter ? meanPass<true>(executor, samples, weights, y) : meanPass<false>(executor, samples, weights, y);
}

/// Size of the features' coordinates at y and of the spread: what rounding scales with.
template <Metric M>
double dataScale(const M& y, const MeanSums<M>& sums) {
  const double spread = sums.weight > 0 ? std::sqrt(2 * static_cast<double>(sums.cost) / sums.weight) : 0;
  return 1 + spread + static_cast<double>(ManifoldTraits<M>::logOrigin(y).norm());
}

template <class S>
double automaticTolerance(double scale) {
  return std::max(1e-12, 4 * static_cast<double>(std::numeric_limits<S>::epsilon()) * scale);
}

template <Metric M, Executor E, class R, class W>
MeanResult<M> frechetMean(const E& executor, const R& samples, const W& weights, const MeanOptions<M>& options) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  MeanResult<M> result;
  result.n = std::ranges::size(samples);
  if (result.n == 0) return result;

  const TangentOf<M> metric = T::metricWeights();
  M y = options.start ? *options.start : startOfMean<M>(samples, weights);
  // In a flat space the start is the mean already.
  MeanPass<M> pass = meanPass(executor, samples, weights, y, !options.start && starts_at_mean<M>);
  result.tolerance = options.tolerance.value_or(automaticTolerance<S>(dataScale(y, pass.sums)));
  result.status = Status::not_converged;
  const auto norm = [&](const TangentOf<M>& v) {
    using std::sqrt;
    return static_cast<double>(sqrt(v.dot(metric.cwiseProduct(v))));
  };

  double previous_residual = std::numeric_limits<double>::infinity();
  while (result.iterations < options.max_iterations) {
    const MeanSums<M>& sums = pass.sums;
    const TangentOf<M> fixed_point = sums.gradient.cwiseQuotient(metric) / S(sums.weight);
    TangentOf<M> step = fixed_point;
    bool newton = false;
    if (options.method == MeanMethod::newton) {
      const Cholesky<S, T::DoF> factor(sums.hessian);
      if (factor.ok()) {
        const TangentOf<M> candidate = factor.solve(sums.gradient);
        // Outside the injectivity radius a Newton step has lost its meaning.
        newton = candidate.allFinite() && norm(candidate) < static_cast<double>(T::injectivityRadius());
        if (newton) step = candidate;
      }
    }
    result.residual = norm(step);
    if (!std::isfinite(result.residual)) break;
    ++result.iterations;
    const M next = exp(y, step);
    if (result.residual <= result.tolerance) {
      // The sums remain those of the point before, which is the mean to the tolerance: no pass over the data for that.
      y = next;
      result.status = Status::ok;
      break;
    }
    // The next step's length: the square of this one by Newton's method (a small multiple of it: clouds are nearly
    // symmetric), the same fraction of it as it is of the previous one by eq. (4).
    const double expected =
        newton ? 1e-4 * result.residual * result.residual : result.residual * (result.residual / previous_residual);
    previous_residual = result.residual;
    MeanPass<M> next_pass = meanPass(executor, samples, weights, next, expected <= result.tolerance);
    if (newton) {
      // Eq. (4) decreases C by at least ½ Σp |δ|²; Newton's step is kept if it does as well, up to rounding.
      const S guaranteed = S(0.5) * S(sums.weight) * fixed_point.dot(metric.cwiseProduct(fixed_point));
      const S rounding = S(8) * std::numeric_limits<S>::epsilon() * sums.cost;
      if (!(next_pass.sums.cost <= sums.cost - guaranteed + rounding)) {
        y = exp(y, fixed_point);
        pass = meanPass(executor, samples, weights, y, false);
        continue;
      }
    }
    y = next, pass = next_pass;
  }

  if (!pass.has_scatter) pass = meanPass<true>(executor, samples, weights, y);
  result.mean = y;
  result.cost = pass.sums.cost;
  result.hessian = pass.sums.hessian;
  result.sum_of_weights = pass.sums.weight;
  result.scatter = pass.scatter.scatter;
  result.squared_weight_scatter = pass.scatter.squared;
  result.largest_distance = pass.scatter.largest;
  result.smallest_gap = pass.scatter.smallest_gap;
  return result;
}

/// States in one sentence why a range of features has no Fréchet mean; `ok` where it has one.
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

/// Fréchet mean of a range of features (LSQ). No features: status too_few. Not finite: not_converged. For manifolds
/// with an invariant metric; SE3 and its like have groupMean and maha.
///
/// The features are any range that can be gone through more than once, of points or of what stands for them: views
/// (Eigen::Map<const SO3d>), columns (Matrix3Xd::colwise()), unit quaternions. The result is of the owning type. Values
/// in random-access memory are used where they are, others are copied once.
template <Executor E, detail::AnyRange R>
MeanResult<detail::SampleInSignature<R>> mean(const E& executor, R&& samples,
                                              const MeanOptions<detail::SampleInSignature<R>>& options = {}) {
  if constexpr (detail::RequireMean<R>::ok) {
    return detail::frechetMean<SampleOf<R>>(executor, detail::asSamples(samples), detail::UnitWeights{}, options);
  } else {
    return {};
  }
}
template <detail::AnyRange R>
MeanResult<detail::SampleInSignature<R>> mean(R&& samples,
                                              const MeanOptions<detail::SampleInSignature<R>>& options = {}) {
  return mean(SerialExecutor{}, samples, options);
}

/// Weighted Fréchet mean (WLSQ): minimises ½ Σ p_i d²(y, x_i). Weights are positive, one for each feature, in any range
/// of numbers (std::vector, Eigen::VectorXd …); what they mean for the covariance is said in stats/covariance.hpp.
template <Executor E, detail::AnyRange R, detail::AnyRange W>
MeanResult<detail::SampleInSignature<R>> mean(const E& executor, R&& samples, W&& weights,
                                              const MeanOptions<detail::SampleInSignature<R>>& options = {}) {
  if constexpr (detail::RequireMean<R>::ok && detail::RequireWeights<W>::ok) {
    const auto features = detail::asSamples(samples);
    const auto numbers = detail::asWeights(weights);
    eigen_assert(features.size() == numbers.size());
    return detail::frechetMean<SampleOf<R>>(executor, features, numbers, options);
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
