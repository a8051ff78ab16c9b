// The covariance of a group's barycentre from its equations averaged over the region that this covariance says: what
// stats/detail/settled_covariance.hpp does for a Fréchet mean.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <stats/detail/angular_part.hpp>
#include <stats/detail/part_growth.hpp>
#include <stats/detail/settled_covariance.hpp>
#include <stats/group_mean.hpp>

#include <cstddef>
#include <ranges>

namespace liestat::detail {

template <LieGroup G>
struct SettledGroupMean {
  SquareOf<G> first;       ///< from the equations at the mean
  SquareOf<G> covariance;  ///< from the averaged ones
  SquareOf<G> jacobian;    ///< the averaged equations' derivative
  double change = 0;       ///< its relative change
  bool settled = false;
};

/// A covariance of first order, with what averaging over the angles adds to it.
template <LieGroup G>
SquareOf<G> withAveragedAngles(const SquareOf<G>& first, const SquareOf<G>& averaged) {
  constexpr auto angular = angularCoordinates<G>();
  constexpr int K = angular.count;
  if constexpr (K > 0 && K < G::DoF) {
    return first + averagedGrowth<K>(first, averaged, coordinatesOf<K>(angular));
  } else {
    return averaged;
  }
}

/// `covariance_of` a barycentre with its jacobian.
template <LieGroup G, class R, class W, class Covariance>
SettledGroupMean<G> settleGroupMean(const R& samples, const W& weights, const GroupMeanResult<G>& mean,
                                    double largest_change, const Covariance& covariance_of) {
  using S = ScalarOf<G>;
  constexpr int D = G::DoF;
  constexpr auto angular = angularCoordinates<G>();
  constexpr int K = angular.count;
  SettledGroupMean<G> settled{covariance_of(mean), {}, mean.jacobian, 0, true};
  settled.covariance = settled.first;
  // A single element is its own mean, with the covariance that it came with.
  if (mean.n == 1) return settled;
  if constexpr (K > 0) {
    using Matrix = Eigen::Matrix<double, D, D>;
    const std::size_t n = std::ranges::size(samples), stride = (n + max_averaged - 1) / max_averaged;
    const double width = averagingWidth(n);
    const double clearance = angleToCutLocus(samples, mean.mean);
    const Matrix at_mean = mean.jacobian.template cast<double>();
    Matrix represented = Matrix::Zero();  // the derivative at the mean of those data that stand for all
    double weight = 0;
    for (std::size_t i = 0; i < n; i += stride) {
      const double p = static_cast<double>(weights[i]);
      const TangentOf<G> z = (mean.mean.inverse() * G(samples[i])).log();
      represented += p * G::leftJacobianInverse(z).template cast<double>();
      weight += p;
    }
    const double scale = mean.sum_of_weights / weight;
    GroupMeanResult<G> averaged = mean;
    for (int i = 0; i < 20; ++i) {
      settled.settled = false;
      const auto L = angularRegion<K>(settled.covariance, angular, width);
      if (!L.allFinite()) return settled;
      if (clearance > cut_locus_margin * reachOf<K>(L)) {
        settled.settled = true;
        return settled;
      }
      const auto derivative = averagedDerivative<D, K>(L, [&](const Eigen::Matrix<double, K, 1>& v) {
        TangentOf<G> step = TangentOf<G>::Zero();
        for (int k = 0; k < K; ++k) step[angular.index[static_cast<std::size_t>(k)]] = static_cast<S>(v[k]);
        const G to_y = (mean.mean * G::exp(step)).inverse();
        Eigen::Matrix<double, D, 1> sum = Eigen::Matrix<double, D, 1>::Zero();
        for (std::size_t j = 0; j < n; j += stride) {
          sum -= static_cast<double>(weights[j]) * (to_y * G(samples[j])).log().template cast<double>();
        }
        return sum;
      });
      Matrix jacobian = at_mean;
      for (int k = 0; k < K; ++k) {
        const int c = angular.index[static_cast<std::size_t>(k)];
        jacobian.col(c) += scale * (derivative.col(k) - represented.col(c));
      }
      // How much flatter: the symmetric part relative to the equations at the mean.
      const Matrix relative = inverse<double, D>(at_mean) * jacobian;
      if (!relative.allFinite()) return settled;
      settled.change = 1 - SymmetricEigen(Matrix(0.5 * (relative + relative.transpose()))).values[0];
      if (!(settled.change <= largest_change)) return settled;
      averaged.jacobian = settled.jacobian = jacobian.template cast<S>();
      const SquareOf<G> next = covariance_of(averaged);
      if (!next.allFinite()) return settled;
      const double step = static_cast<double>((next - settled.covariance).norm());
      const double size = static_cast<double>(settled.covariance.norm());
      settled.covariance = next;
      if (step <= 0.02 * size) {
        settled.covariance = withAveragedAngles<G>(settled.first, next);
        settled.settled = true;
        return settled;
      }
    }
    settled.settled = false;
  }
  return settled;
}

}  // namespace liestat::detail
