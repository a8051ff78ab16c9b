// Gaussian<M>: a feature with its covariance, and how the pair moves between frames and charts.
#pragma once

#include <lie/manifold.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>

#include <cmath>
#include <limits>

namespace liestat {

/// A feature and the covariance of its error in the local frame carried by its placement (for a group: x·Exp(e),
/// e ~ N(0, covariance)). Covariance in the tangent order of M, rad and m.
template <Homogeneous M>
struct Gaussian {
  M mean = ManifoldTraits<M>::origin();
  SquareOf<M> covariance = SquareOf<M>::Identity();
};

/// Squared Mahalanobis distance zᵀ Σ⁻¹ z of a tangent vector; NaN if Σ is not positive definite.
template <class S, int N>
S mahalanobisSquared(const Eigen::Matrix<S, N, 1>& z, const Eigen::Matrix<S, N, N>& covariance) {
  return detail::Cholesky<S, N>(covariance).halfSolve(z).squaredNorm();
}

/// Squared Mahalanobis distance of y from the Gaussian, in the exponential chart at its mean (Pennec 1998,
/// section 4.2); NaN if the covariance is not positive definite. Its square root is `mahalanobis`.
template <Homogeneous M>
ScalarOf<M> mahalanobisSquared(const Gaussian<M>& g, const M& y) {
  return mahalanobisSquared<ScalarOf<M>, ManifoldTraits<M>::DoF>(log(g.mean, y), g.covariance);
}
template <Homogeneous M>
ScalarOf<M> mahalanobis(const Gaussian<M>& g, const M& y) {
  using std::sqrt;
  return sqrt(mahalanobisSquared(g, y));
}

/// Squared distance of two independent estimates of the same feature under both their covariances, carried to one
/// frame: zᵀ (L Σ_a Lᵀ + D Σ_b Dᵀ)⁻¹ z, z = log(a, b). It follows χ²_k where both covariances are of known noise
/// (Pennec 1998, section 5.2, which leaves the sum open; first order). NaN if the sum is not positive definite.
template <Homogeneous M>
ScalarOf<M> mahalanobisSquared(const Gaussian<M>& a, const Gaussian<M>& b) {
  const ErrorVector<M> e = errorVector(a.mean, b.mean);
  const SquareOf<M> sum = detail::congruence(e.by_base, a.covariance) + detail::congruence(e.by_feature, b.covariance);
  return mahalanobisSquared<ScalarOf<M>, ManifoldTraits<M>::DoF>(e.z, sum);
}

/// The Gaussian moved by a transformation: mean f⋆x, covariance turned by the isotropy; exact.
template <Homogeneous M>
Gaussian<M> act(const typename ManifoldTraits<M>::Group& f, const Gaussian<M>& g) {
  const SquareOf<M> J = actionFeatureJacobian(f, g.mean);
  return {act(f, g.mean), detail::congruence(J, g.covariance)};
}

/// The covariance of g carried to the frame at y by the transformation that leads from g.mean to y along exp (parallel
/// transport on the sphere, none where the isotropy is trivial).
template <Homogeneous M>
Gaussian<M> transport(const Gaussian<M>& g, const M& y) {
  const SquareOf<M> T = frameTransport(g.mean, y);
  return {y, detail::congruence(T, g.covariance)};
}

/// Covariance in the principal chart of the report, Σ_chart = J(f_x) Σ J(f_x)ᵀ (first order), and back.
template <Homogeneous M>
SquareOf<M> principalChartCovariance(const Gaussian<M>& g) {
  const SquareOf<M> J = principalChartJacobian(g.mean);
  return detail::congruence(J, g.covariance);
}
template <Homogeneous M>
SquareOf<M> covarianceFromPrincipalChart(const M& x, const SquareOf<M>& chart_covariance) {
  const SquareOf<M> J = detail::inverse<ScalarOf<M>, ManifoldTraits<M>::DoF>(principalChartJacobian(x));
  return detail::congruence(J, chart_covariance);
}

}  // namespace liestat
