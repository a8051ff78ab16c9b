// The Hessian of a mean's criterion averaged over the region in which the truth is believed to be. Needs Eigen alone.
//
// A covariance H⁻¹ S H⁻¹ takes the slope of the gradient at the mean for the slope across the whole region between mean
// and truth. Among scattered data these differ. Where two geodesics to a datum are equally long the gradient jumps, and
// no Hessian of a sample sees it (docs/theory/means.md, section 7.5); on the sphere the curvature diverges towards the
// antipode; and of several places the minimum of a sample is found where the criterion happens to be steep. So the
// slope is measured: with v ~ N(0, C), g(v) the gradient at exp(mean, v), E[g(v) vᵀ] C⁻¹ is the average of the Hessian
// over that normal law (Stein's identity; docs/theory/means.md, section 7.6), kinks and all. It needs nothing but log,
// and weighs the effect of data near the cut locus on the estimate, not their mass.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <stats/detail/averaged_slope.hpp>
#include <stats/detail/compact_part.hpp>
#include <stats/detail/find_uniqueness.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/detail/weights.hpp>
#include <stats/mean.hpp>

#include <Eigen/Eigenvalues>

#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <tuple>

namespace liestat {

/// What averagedHessian() returns.
template <Metric M>
struct AveragedHessian {
  SquareOf<M> hessian = SquareOf<M>::Zero();  ///< that at the mean where it was not averaged
  /// 1 - the least eigenvalue relative to the Hessian at the mean: 0 unchanged, 1 the criterion is flat; NaN where that
  /// Hessian is not positive definite.
  double change = 0;
  bool averaged = false;  ///< false: no datum's cut locus is near the region, and nothing was done
};

namespace detail {

/// The lower factor of the region's covariance in the coordinates over which a Hessian is averaged; NaN if it has none.
template <Metric M>
auto regionFactor(const SquareOf<M>& covariance) {
  constexpr int K = averaged_dimension<M>, begin = averagedBegin<M>();
  using Matrix = Eigen::Matrix<double, K, K>;
  Matrix region = covariance.template block<K, K>(begin, begin).template cast<double>();
  region.diagonal().array() += min_region_sigma * min_region_sigma;
  return Matrix(lowerFactor<K>(region));
}

/// True if the sums of a mean prove that findAveragedHessian averages nothing over `width` times the region of a covariance.
template <Metric M>
bool isHessianSettledBySums(const MeanResult<M>& mean, const SquareOf<M>& covariance, double width) {
  if constexpr (Factored<M>) {
    return false;
  } else if constexpr (compactFactor<M>() != CompactFactor::none) {
    // The norm of the region's factor needs no factor. A region that has none has a trace too large, or none.
    constexpr int K = averaged_dimension<M>, begin = averagedBegin<M>();
    const double squares = width * width * static_cast<double>(covariance.template block<K, K>(begin, begin).trace()) +
                           K * min_region_sigma * min_region_sigma;
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
    const Matrix L = regionFactor<M>(covariance);
    if (!L.allFinite()) {
      result.change = std::numeric_limits<double>::quiet_NaN();
      return result;
    }
    if (leastDistanceToCutLocus(mean) > cut_locus_margin * longestReach<K>(L) ||
        distanceToCutLocus(samples, mean.mean) > cut_locus_margin * reachOf<K>(L)) {
      result.averaged = false;
      return result;
    }

    const std::size_t n = std::ranges::size(samples), stride = (n + most_averaged - 1) / most_averaged;
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
    result.change = 1 - Eigen::SelfAdjointEigenSolver<Matrix>(relative).eigenvalues()[0];
    // Of many data the ratio is carried over to the Hessian of all.
    Matrix averaged = slope;
    if (stride > 1) {
      const Matrix all = mean.hessian.template block<K, K>(begin, begin).template cast<double>();
      const Matrix half = lowerFactor<K>(all);
      averaged = half * relative * half.transpose();
    }
    result.hessian.template block<K, K>(begin, begin) = averaged.template cast<S>();
  }
  return result;
}

}  // namespace detail

/// The Hessian of ½ Σ p_i d²(·, x_i) averaged over the normal law about the mean of the given covariance (local frame,
/// rad², no less than 0.05 rad wide): the slope of the gradient across that region. Metric manifolds; of frames the
/// rotation's block, of products each factor by itself. Of more than 4096 data every m-th is taken.
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
