// The formulas of Pennec 1998 as printed, for comparison only. They neglect curvature, count residuals twice or use a
// gradient that is not the criterion's (docs/theory/means.md, section 6, errata 2, 18, 10); the library's own are in
// stats/covariance.hpp and stats/maha.hpp. Repaired only where they would not run: inverse covariances, transposes, the
// update's H⁻¹.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/maha.hpp>
#include <stats/mean.hpp>

namespace liestat::printed {

/// LSQ or WLSQ covariance, known noise, sections 3.3 and 4.1: Σ p_i² Σ_zz / (Σ p_i)² with Σ_zz = D S_i Dᵀ, S_i the
/// covariance attached to the measured feature x_i.
template <SampleRange R, WeightRange W, std::ranges::forward_range V, Metric M = SampleOf<R>>
SquareOf<M> covarianceFromNoise(R&& samples, W&& weights, V&& noise, const std::type_identity_t<M>& mean) {
  const auto x = detail::asSamples(samples);
  const auto numbers = detail::asWeights(weights);
  const auto covariances = detail::asValues<SquareOf<M>>(noise);
  SquareOf<M> sum = SquareOf<M>::Zero();
  ScalarOf<M> weight(0);
  for (std::size_t i = 0; i < x.size(); ++i) {
    const ScalarOf<M> p = ScalarOf<M>(numbers[i]);
    const SquareOf<M> D = errorVector(mean, x[i]).by_feature;
    sum += p * p * detail::congruence(D, covariances[i]);
    weight += p;
  }
  return sum / (weight * weight);
}

/// The same with Σ_zz = V_i, no curvature at all: the linear formula of points.
template <Metric M, class W, class V>
SquareOf<M> flatCovariance(std::size_t n, const W& weights, const V& noise) {
  SquareOf<M> sum = SquareOf<M>::Zero();
  ScalarOf<M> weight(0);
  for (std::size_t i = 0; i < n; ++i) {
    const ScalarOf<M> p = ScalarOf<M>(weights[i]);
    sum += p * p * noise[i];
    weight += p;
  }
  return sum / (weight * weight);
}

/// LSQ or WLSQ covariance from residuals, eq. (6) and section 4.1: Σ p_i z_i z_iᵀ / ((n - 1) Σ p_i).
template <Metric M>
SquareOf<M> covarianceFromResiduals(const MeanResult<M>& result) {
  using S = ScalarOf<M>;
  return result.scatter / (S(result.n - 1) * S(result.sum_of_weights));
}

/// MAHA of section 4.2 with the printed Φ = Σ Lᵀ Σ_zz⁻¹ z, H = Σ Lᵀ Σ_zz⁻¹ L, Σ_zz = D S Dᵀ, covariance H⁻¹. No
/// safeguard, as in the report: it may not converge.
template <std::ranges::forward_range R, class M = detail::FeatureInSignature<R>>
MahaResult<M> maha(R&& range, const MahaOptions<std::type_identity_t<M>>& options = {}) {
  const auto samples = detail::asValues<Gaussian<M>>(range);
  MahaResult<M> result;
  result.n = samples.size();
  if (result.n == 0) return result;
  M y = options.start ? *options.start : samples[0].mean;
  result.tolerance = options.tolerance.value_or(1e-10);
  result.status = Status::not_converged;
  SquareOf<M> H;
  while (result.iterations < options.max_iterations) {
    H.setZero();
    TangentOf<M> phi = TangentOf<M>::Zero();
    result.cost = 0;
    for (const Gaussian<M>& g : samples) {
      const ErrorVector<M> e = errorVector(y, g.mean);
      const SquareOf<M> information =
          detail::Cholesky<ScalarOf<M>, ManifoldTraits<M>::DoF>(detail::congruence(e.by_feature, g.covariance))
              .inverse();
      const SquareOf<M> weighted = e.by_base.transpose() * information;
      result.cost += ScalarOf<M>(0.5) * e.z.dot(information * e.z);
      phi += weighted * e.z;
      H += weighted * e.by_base;
    }
    const TangentOf<M> step = -detail::Cholesky<ScalarOf<M>, ManifoldTraits<M>::DoF>(H).solve(phi);
    result.residual = static_cast<double>(step.norm());
    if (!std::isfinite(result.residual)) break;
    ++result.iterations;
    y = exp(y, step);
    if (result.residual <= result.tolerance) {
      result.status = Status::ok;
      break;
    }
  }
  result.mean = y;
  result.hessian = result.gauss_newton = H;
  if (converged(result.status)) result.covariance = detail::Cholesky<ScalarOf<M>, ManifoldTraits<M>::DoF>(H).inverse();
  return result;
}

}  // namespace liestat::printed
