// Covariances of a mean (LSQ, WLSQ), from known noise or from residuals, and of data about a feature.
//
// All of them are H⁻¹ (…) H⁻¹ with the exact Hessian: the central limit theorem for Fréchet means
// (docs/theory/means.md, section 3.4). The report's printed formulas, for comparison, are in stats/printed.hpp.
// Matrices are in the local frame at the mean.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/detail/weights.hpp>
#include <stats/mean.hpp>
#include <stats/residual_noise.hpp>

#include <cmath>

namespace liestat {

namespace detail {

/// H⁻¹ W S W H⁻¹; NaN where H is not positive definite.
template <Metric M>
SquareOf<M> sandwich(const MeanResult<M>& result, const SquareOf<M>& S) {
  const DiagonalCholesky<ScalarOf<M>, ManifoldTraits<M>::DoF> factor(result.hessian);
  const SquareOf<M> G = factor.solve(SquareOf<M>(ManifoldTraits<M>::metricWeights().asDiagonal()));
  return congruence(G, S);
}

/// States in one sentence what is wrong with a range of covariances; `ok` where nothing is.
template <Metric M, AnyRange V>
struct RequireMatrices {
  static constexpr bool ok = std::convertible_to<ElementOf<V>, SquareOf<M>>;
  static_assert(ok, "liestat: noise is a range of covariances, DoF x DoF matrices of the features' scalar type.");
};

}  // namespace detail

/// Covariance of the mean when the noise is known: V_i is the covariance of z_i = log(mean, x_i), that is of the noise
/// in the frame of the estimate (for x_i = exp(x, e_i), Cov(e_i)). H⁻¹ (Σ p_i² V_i) H⁻¹. Squared distances follow χ²_k.
/// noise is any range of such matrices, weights of numbers.
template <Metric M, detail::AnyRange V>
SquareOf<M> covarianceFromNoise(const MeanResult<M>& result, V&& noise) {
  SquareOf<M> sum = SquareOf<M>::Zero();
  if constexpr (detail::RequireMatrices<M, V>::ok) {
    std::size_t n = 0;
    for (const auto& v : noise) sum += v, ++n;
    eigen_assert(n == result.n);
  }
  return detail::sandwich(result, sum);
}
template <Metric M, detail::AnyRange W, detail::AnyRange V>
SquareOf<M> covarianceFromNoise(const MeanResult<M>& result, W&& weights, V&& noise) {
  SquareOf<M> sum = SquareOf<M>::Zero();
  if constexpr (detail::RequireMatrices<M, V>::ok && detail::RequireWeights<W>::ok) {
    // As mean() saw them.
    const auto p = detail::asWeights(weights);
    const detail::WeightScale scale = detail::weightScale<ScalarOf<M>>(p, p.size());
    eigen_assert(scale.kept == result.n);
    if (!scale.valid) return SquareOf<M>::Constant(std::numeric_limits<ScalarOf<M>>::quiet_NaN());
    std::size_t i = 0;
    for (const auto& v : noise) {
      const ScalarOf<M> weight = static_cast<ScalarOf<M>>(scale(p[i++]));
      sum += weight * weight * v;
    }
    eigen_assert(i == p.size());
  }
  return detail::sandwich(result, sum);
}
/// The same when every measurement has the covariance V.
template <Metric M>
SquareOf<M> covarianceFromCommonNoise(const MeanResult<M>& result, const SquareOf<M>& V) {
  return detail::sandwich(result, SquareOf<M>(ScalarOf<M>(result.n) * V));
}

/// Covariance of the mean when the noise is unknown, from the residuals. Squared distances follow Hotelling's law
/// (stats/inference.hpp), not χ²; with ResidualNoise::any the sums of the mean know too little of the weights for a
/// law, which certifiedMean has. Rank min(n - 1, k): with fewer than k + 1 measurements it is singular. NaN for one
/// measurement.
template <Metric M>
LIESTAT_NO_INLINE SquareOf<M> covarianceFromResiduals(const MeanResult<M>& result,
                                                      ResidualNoise noise = ResidualNoise::scaled) {
  using S = ScalarOf<M>;
  const S n = S(result.n);
  if (result.n < 2) return SquareOf<M>::Constant(std::numeric_limits<S>::quiet_NaN());
  if (noise == ResidualNoise::frequency) {
    const S sum = S(result.sum_of_weights);
    return detail::sandwich(result, SquareOf<M>(result.scatter * (sum / (sum - S(1)))));
  }
  if (noise == ResidualNoise::any) {
    return detail::sandwich(result, SquareOf<M>(result.squared_weight_scatter * (n / (n - S(1)))));
  }
  return detail::sandwich(result, SquareOf<M>(result.scatter * (S(result.sum_of_weights) / (n - S(1)))));
}

/// Empirical covariance of the data about a given feature y, (1/n) Σ log(y, x_i) log(y, x_i)ᵀ: eq. (1) of the report in
/// the local frame at y. principalChartCovariance converts it to the report's chart.
template <detail::AnyRange R, class M = detail::SampleInSignature<R>>
SquareOf<M> empiricalCovariance(R&& samples, const std::type_identity_t<M>& y) {
  SquareOf<M> sum = SquareOf<M>::Zero();
  std::size_t n = 0;
  if constexpr (detail::RequireSamples<R>::ok) {
    using T = ManifoldTraits<M>;
    const typename T::Group to_y = T::placement(y).inverse();
    for (const M& x : detail::asSamples(samples)) {
      const TangentOf<M> z = T::logOrigin(T::act(to_y, x));
      sum += z * z.transpose();
      ++n;
    }
  }
  return sum / ScalarOf<M>(n);
}

/// True if a covariance (symmetric, at most 13×13) leaves some direction without any error, whatever the units: a
/// variance that is not positive, or an eigenvalue of the correlation matrix that is not above 1e-10. True for NaN.
template <class Derived>
bool isSingular(const Eigen::MatrixBase<Derived>& covariance) {
  const int k = static_cast<int>(covariance.rows());
  eigen_assert(covariance.cols() == k && k <= detail::SmallMatrix::most);
  detail::SmallMatrix correlation(k, k);
  for (int i = 0; i < k; ++i) {
    for (int j = 0; j < k; ++j) {
      const double scale = std::sqrt(static_cast<double>(covariance(i, i)) * static_cast<double>(covariance(j, j)));
      correlation(i, j) = static_cast<double>(covariance(i, j)) / scale;
      if (!std::isfinite(correlation(i, j))) return true;
    }
  }
  // Singular values are the eigenvalues' absolute values, and a covariance has none below zero but by rounding.
  return k > 0 && !(detail::SmallSvd(correlation).value(k - 1) > 1e-10);
}

}  // namespace liestat
