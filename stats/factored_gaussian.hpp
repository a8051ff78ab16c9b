// FactoredGaussian<M>: a feature with a factor of its covariance, from which maha() and fuse() keep small variances.
#pragma once

#include <lie/detail/small_factors.hpp>
#include <lie/manifold.hpp>
#include <stats/gaussian.hpp>

namespace liestat {

/// A feature and a factor A of the covariance A Aᵀ of its error: x·Exp(A n), n ~ N(0, I). A matrix of variances has the
/// smallest one to eps times the largest, a factor to the root of that and, if its columns are standard deviations
/// along principal axes, to eps.
template <Homogeneous M>
struct FactoredGaussian {
  M mean = ManifoldTraits<M>::origin();
  SquareOf<M> factor = SquareOf<M>::Identity();

  /// Standard deviations along the axes of the feature's frame, in the tangent order of M, rad and m.
  static FactoredGaussian fromDeviations(const M& mean, const TangentOf<M>& deviations) {
    return {mean, deviations.asDiagonal()};
  }
  /// The same with the covariance in place of its factor: symmetric to the last bit, and with a Cholesky factor where A
  /// is regular.
  Gaussian<M> gaussian() const { return {mean, detail::squareOfFactor<ScalarOf<M>, ManifoldTraits<M>::DoF>(factor)}; }
};

}  // namespace liestat
