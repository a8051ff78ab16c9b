// Options and results of maha() of stats/maha.hpp.
#pragma once

#include <lie/manifold.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/gaussian.hpp>
#include <stats/noise_fit.hpp>
#include <stats/status.hpp>

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

namespace liestat {

/// The frame in which a measurement's covariance is expressed.
enum class CovarianceAt { measured, estimated };

enum class MahaMethod {
  newton,       ///< exact Hessian where the manifold offers it and it is positive definite, else Gauss-Newton's
  gauss_newton  ///< Σ Jᵀ S⁻¹ J: linear convergence at large spread
};

/// Options of maha().
template <Homogeneous M>
struct MahaOptions {
  MahaMethod method = MahaMethod::newton;
  /// Stop when a step's norm (rad, m) falls below; unset: max(1e-12, 4 eps (scale of the data)). Steps that rounding
  /// keeps above it end the iteration too, once they are below √eps standard deviations of the estimate.
  std::optional<double> tolerance = {};
  int max_iterations = 100;
  /// Where to start; unset: the chordal mean weighted by det(Σ_i)^(-1/k), for quotients the best of several data.
  std::optional<M> start = {};
  /// Adds the log-determinant of the volume element: the maximum likelihood of noise that is Gaussian in the chart.
  bool likelihood = false;
  double refutation_level = liestat::refutation_level;  ///< a less probable fit refutes the covariances; 0: none does
};

/// The result of maha(). Matrices are in the local frame at the mean.
template <Homogeneous M>
struct MahaResult {
  M mean = ManifoldTraits<M>::origin();
  Status status = Status::too_few;
  int iterations = 0;    ///< steps taken, the last one below the tolerance
  double residual = 0;   ///< norm of the last step
  double tolerance = 0;  ///< the one that was used
  std::size_t n = 0;
  ScalarOf<M> cost = 0;                            ///< ½ Σ μ_i², with the volume terms if likelihood was asked for
  SquareOf<M> hessian = SquareOf<M>::Zero();       ///< exact Hessian of the cost
  SquareOf<M> gauss_newton = SquareOf<M>::Zero();  ///< Σ Jᵀ S⁻¹ J
  /// A with A Aᵀ = H_GN⁻¹, and Aᵀ H A: what the matrices above lose where standard deviations differ by thousands.
  SquareOf<M> axes = SquareOf<M>::Identity(), relative_hessian = SquareOf<M>::Identity();
  /// A factor F of the covariance F Fᵀ, which has the small variances to more digits than the matrix can hold.
  SquareOf<M> factor = SquareOf<M>::Constant(std::numeric_limits<ScalarOf<M>>::quiet_NaN());
  /// H⁻¹ H_GN H⁻¹, or H⁻¹ with likelihood (docs/theory/means.md, section 4.3), symmetric and with a Cholesky factor;
  /// NaN where H is not positive definite.
  SquareOf<M> covariance = SquareOf<M>::Constant(std::numeric_limits<ScalarOf<M>>::quiet_NaN());
  NoiseFit fit;  ///< Σ μ_i², of k (n - 1) degrees of freedom, where the iteration converged

  /// Mean and covariance together.
  Gaussian<M> estimate() const { return {mean, covariance}; }
};

/// det(Σ)^(-1/k): the weight that WLSQ gives to a measurement of covariance Σ (Pennec 1998, section 5.1).
template <class S, int N>
S scalarWeight(const Eigen::Matrix<S, N, N>& covariance) {
  using std::exp;
  return exp(-detail::Cholesky<S, N>(covariance).logDeterminant() / S(N));
}

}  // namespace liestat
