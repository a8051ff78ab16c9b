// The Hessian of a mean's criterion averaged over the confidence region of the mean. Needs Eigen alone.
//
// A covariance H⁻¹ S H⁻¹ assumes that the slope of the gradient at the mean holds between mean and truth. With
// scattered data it does not: the gradient jumps where two geodesics to a datum are equally long, which the Hessian of
// a sample never contains (docs/theory/means.md, section 7.5); the curvature of the sphere diverges towards the
// antipode; and the minimum of a sample tends to lie where its criterion is steep by chance. The Hessian averaged over
// v ~ N(0, C) accounts for all three. By Stein's identity it is E[g(v) vᵀ] C⁻¹, g(v) the gradient at exp(mean, v),
// kinks included (section 7.6): it needs log alone, and data near the cut locus count by their effect on the gradient.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/detail/averaged_slope.hpp>
#include <stats/detail/compact_part.hpp>
#include <stats/detail/find_uniqueness.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/weights.hpp>
#include <stats/mean.hpp>

#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <tuple>

namespace liestat {

/// The result of averagedHessian().
template <Metric M>
struct AveragedHessian {
  SquareOf<M> hessian = SquareOf<M>::Zero();  ///< the averaged Hessian, or that at the mean if not averaged
  /// 1 - the least eigenvalue relative to the Hessian at the mean: 0 unchanged, 1 a flat criterion; NaN if that Hessian
  /// is not positive definite.
  double change = 0;
  bool averaged = false;  ///< false: the cut loci of all data are far from the region
};

namespace detail {

/// The least standard deviation to average over, rad: in a space of short injectivity radius (below that of the frames'
/// quotients) in proportion.
template <Metric M>
double minRegionSigma(const M& mean) {
  return min_region_sigma * std::min(1.0, 2 / pi * static_cast<double>(injectivityRadiusAt(mean)));
}

/// The lower Cholesky factor of the region's covariance in the coordinates that are averaged over; NaN if it has none.
template <Metric M>
auto regionFactor(const SquareOf<M>& covariance, double least_sigma) {
  constexpr int K = averaged_dimension<M>, begin = averagedBegin<M>();
  using Matrix = Eigen::Matrix<double, K, K>;
  Matrix region = covariance.template block<K, K>(begin, begin).template cast<double>();
  region.diagonal().array() += least_sigma * least_sigma;
  return Cholesky<double, K>(region).lower();
}

/// True if the sums of a mean prove that findAveragedHessian does not average over `width` times a covariance's region.
template <Metric M>
bool isHessianSettledBySums(const MeanResult<M>& mean, const SquareOf<M>& covariance, double width) {
  if constexpr (Factored<M>) {
    return false;
  } else if constexpr (compactFactor<M>() != CompactFactor::none) {
    // The Frobenius norm of the factor is the root of the trace. If there is no factor, the trace is too large or NaN.
    constexpr int K = averaged_dimension<M>, begin = averagedBegin<M>();
    const double least_sigma = minRegionSigma(mean.mean);
    const double squares = width * width * static_cast<double>(covariance.template block<K, K>(begin, begin).trace()) +
                           K * least_sigma * least_sigma;
    return leastDistanceToCutLocus(mean) > cut_locus_margin * std::sqrt(squares) * NormalNodes<K>::instance().longest();
  } else {
    return true;
  }
}

template <Metric M, class R, class W>
AveragedHessian<M> findAveragedHessian(const R& samples, const W& weights, const MeanResult<M>& mean,
                                       const SquareOf<M>& covariance) {
  eigen_assert(haveOneSize(samples, weights));
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  AveragedHessian<M> result{mean.hessian, 0, false};
  if constexpr (Factored<M>) {
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      using F = std::tuple_element_t<i, FactorsOf<M>>;
      constexpr int k = ManifoldTraits<F>::DoF, begin = factorOffset<i, M>();
      const auto part = findAveragedHessian(FactorRange<i, M, R>{samples}, weights,
                                            factorMean<i>(SerialExecutor{}, samples, weights, mean),
                                            SquareOf<F>(covariance.template block<k, k>(begin, begin)));
      if (!part.averaged) return;
      result.hessian.template block<k, k>(begin, begin) = part.hessian;
      if (!result.averaged || !(part.change <= result.change)) result.change = part.change;
      result.averaged = true;
    });
  } else if constexpr (compactFactor<M>() != CompactFactor::none) {
    constexpr int K = averaged_dimension<M>, begin = averagedBegin<M>();
    using Vector = Eigen::Matrix<double, K, 1>;
    using Matrix = Eigen::Matrix<double, K, K>;
    result.averaged = true;
    const Matrix L = regionFactor<M>(covariance, minRegionSigma(mean.mean));
    if (!L.allFinite()) {
      result.change = std::numeric_limits<double>::quiet_NaN();
      return result;
    }
    if (leastDistanceToCutLocus(mean) > cut_locus_margin * longestReach<K>(L) ||
        distanceToCutLocus(samples, mean.mean) > cut_locus_margin * reachOf<K>(L)) {
      result.averaged = false;
      return result;
    }

    const std::size_t n = std::ranges::size(samples), stride = (n + max_averaged - 1) / max_averaged;
    const TangentOf<M> metric = T::metricWeights();
    const auto sums = [&](const M& y, const auto& add) {
      const auto to_y = T::placement(y).inverse();
      for (std::size_t i = 0; i < n; i += stride) {
        add(static_cast<double>(weights[i]), TangentOf<M>(T::logOrigin(T::act(to_y, M(samples[i])))));
      }
    };
    Matrix at_mean = Matrix::Zero();
    sums(mean.mean, [&](double p, const TangentOf<M>& z) {
      at_mean += p * T::hessianHalfSquaredDistance(z).template block<K, K>(begin, begin).template cast<double>();
    });
    const Matrix derivative = averagedDerivative<K, K>(L, [&](const Vector& v) -> Vector {
      TangentOf<M> step = TangentOf<M>::Zero();
      step.template segment<K>(begin) = v.template cast<S>();
      const M y = exp(mean.mean, step);
      TangentOf<M> gradient = TangentOf<M>::Zero();
      sums(y, [&](double p, const TangentOf<M>& z) { gradient -= S(p) * metric.cwiseProduct(z); });
      gradient = (frameTransport(mean.mean, y).transpose() * gradient).eval();
      return gradient.template segment<K>(begin).template cast<double>();
    });
    const Matrix slope = 0.5 * (derivative + derivative.transpose());
    const Cholesky<double, K> factor(at_mean);
    if (!factor.ok() || !slope.allFinite()) {
      result.change = std::numeric_limits<double>::quiet_NaN();
      return result;
    }
    const Matrix relative = factor.halfSolve(Matrix(factor.halfSolve(slope).transpose()));
    result.change = 1 - detail::SymmetricEigen(relative).values[0];
    // A thinned sample gives the relative change, which is applied to the Hessian of all data.
    Matrix averaged = slope;
    if (stride > 1) {
      const Matrix all = mean.hessian.template block<K, K>(begin, begin).template cast<double>();
      const Matrix half = Cholesky<double, K>(all).lower();
      averaged = half * relative * half.transpose();
    }
    result.hessian.template block<K, K>(begin, begin) = averaged.template cast<S>();
  }
  return result;
}

}  // namespace detail

/// The Hessian of ½ Σ p_i d²(·, x_i) averaged over the normal distribution about the mean with the given covariance
/// (local frame, rad²; 0.05 rad are added to it in quadrature). Metric manifolds; frames average the rotation's block,
/// products each factor by itself. More than 4096 data are thinned to every m-th. Bad weights: `change` is NaN.
template <detail::AnyRange R, class M = detail::MetricInSignature<R>>
AveragedHessian<M> averagedHessian(R&& samples, const MeanResult<std::type_identity_t<M>>& mean,
                                   const SquareOf<M>& covariance) {
  if constexpr (detail::RequireMean<R>::ok) {
    return detail::findAveragedHessian(detail::asSamples(samples), detail::UnitWeights{}, mean, covariance);
  } else {
    return {};
  }
}
template <detail::AnyRange R, detail::AnyRange W, class M = detail::MetricInSignature<R>>
AveragedHessian<M> averagedHessian(R&& samples, W&& weights, const MeanResult<std::type_identity_t<M>>& mean,
                                   const SquareOf<M>& covariance) {
  if constexpr (detail::RequireMean<R>::ok && detail::RequireWeights<W>::ok) {
    return detail::withRelativeWeights<M>(
        detail::asSamples(samples), detail::asWeights(weights),
        [&](const auto& features, const auto& numbers, const detail::KeptRows&) {
          return detail::findAveragedHessian(features, numbers, mean, covariance);
        },
        [] {
          AveragedHessian<M> none;
          none.change = std::numeric_limits<double>::quiet_NaN();
          return none;
        });
  } else {
    return {};
  }
}

}  // namespace liestat
