// The covariance of a mean from the Hessian averaged over the region that this covariance says.
#pragma once

#include <stats/averaged_hessian.hpp>
#include <stats/detail/part_growth.hpp>
#include <stats/mean.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <tuple>

namespace liestat {

/// The change of the Hessian across the confidence region up to which a covariance is given: beyond, its slope is less
/// than a quarter of that at the mean, the region no longer settles, and where it does the covariance of scattered
/// quotient frames is too small.
inline constexpr double largest_hessian_change = 0.75;

}  // namespace liestat

namespace liestat::detail {

template <Metric M>
struct SettledCovariance {
  SquareOf<M> first;       ///< from the Hessian at the mean
  SquareOf<M> covariance;  ///< with what the averaged one adds
  SquareOf<M> hessian;     ///< the averaged Hessian
  double change = 0;       ///< relative change of the Hessian
  bool settled = false;    ///< false: too large a change, or no end of the iteration
};

/// How many standard deviations wide the averaging law is. The truth lies up to three of them away, and a minimum is
/// found where the criterion is steep by chance, which a narrow average sees in part only: at two the coverage of
/// scattered rotations and directions holds. Fewer than twenty data say less about places that far off, and Hotelling's
/// law widens their region already.
inline constexpr double averaging_width = 2;
inline double averagingWidth(std::size_t n) { return std::min(averaging_width, 0.1 * static_cast<double>(n)); }

/// A covariance from the Hessian at the mean with what one from the averaged Hessian adds (averagedGrowth), for each
/// part that is averaged over. Of a space that is averaged over as a whole, the averaged one itself.
template <Metric M, int D>
void addAveragedGrowth(const Eigen::Matrix<ScalarOf<M>, D, D>& first, const Eigen::Matrix<ScalarOf<M>, D, D>& averaged,
                       Eigen::Matrix<ScalarOf<M>, D, D>& sum, int offset = 0) {
  if constexpr (Factored<M>) {
    forEachIndex<std::tuple_size_v<FactorsOf<M>>>([&](auto i) {
      addAveragedGrowth<std::tuple_element_t<i, FactorsOf<M>>, D>(first, averaged, sum, offset + factorOffset<i, M>());
    });
  } else if constexpr (compactFactor<M>() != CompactFactor::none) {
    sum += averagedGrowth<averaged_dimension<M>>(first, averaged,
                                                 coordinatesFrom<averaged_dimension<M>>(offset + averagedBegin<M>()));
  }
}
template <Metric M>
SquareOf<M> withAveragedGrowth(const SquareOf<M>& first, const SquareOf<M>& averaged) {
  constexpr int D = ManifoldTraits<M>::DoF;
  if constexpr (!Factored<M> && averaged_dimension<M> == D) return averaged;
  SquareOf<M> sum = first;
  addAveragedGrowth<M, D>(first, averaged, sum);
  return sum;
}

/// Iterates: covariance of a mean by covariance_of(mean with its Hessian), region, averaged Hessian.
template <Metric M, class R, class W, class Covariance>
SettledCovariance<M> settleCovariance(const R& samples, const W& weights, const MeanResult<M>& mean,
                                      double largest_change, const Covariance& covariance_of) {
  using S = ScalarOf<M>;
  SettledCovariance<M> result;
  result.first = result.covariance = covariance_of(mean);
  result.hessian = mean.hessian;
  if (!result.first.allFinite()) return result;
  // A single datum is its own mean, with the covariance that it came with.
  result.settled = mean.n == 1;
  if (result.settled) return result;
  const double width = averagingWidth(mean.n);
  MeanResult<M> averaged = mean;
  for (int i = 0; i < 20; ++i) {
    const AveragedHessian<M> found =
        findAveragedHessian(samples, weights, mean, SquareOf<M>(S(width * width) * result.covariance));
    result.change = found.change;
    if (!(found.change <= largest_change)) return result;
    if (!found.averaged) {
      result.settled = true;
      return result;
    }
    averaged.hessian = result.hessian = found.hessian;
    const SquareOf<M> next = covariance_of(averaged);
    if (!next.allFinite()) return result;
    const double step = static_cast<double>((next - result.covariance).norm());
    const double size = static_cast<double>(result.covariance.norm());
    result.covariance = next;
    if (step <= 0.02 * size) {
      result.covariance = withAveragedGrowth<M>(result.first, next);
      result.settled = true;
      return result;
    }
  }
  return result;
}

}  // namespace liestat::detail
