// The unscented transform on manifolds (Julier and Uhlmann 2004), and the mean that it needs: about a reference, with
// weights of any sign. Needs Eigen alone.
//
//   const auto image = unscentedTransform(gaussian, [](const SE3d& pose) { return S2d(pose.so3() * axis); });
//
// Sigma points exp(mean, ±√c column of L), L Lᵀ the covariance, of weight 1/2c each, and the mean itself of weight
// 1 - k/c have the moments of the normal law to the third order, and with c = 3 its fourth along each column. From four
// dimensions on the middle's weight is negative then: the sum of squared distances has no minimum that a mean of
// positive weights would look for, but the weighted residuals still vanish at one place near the middle's image.
#pragma once

#include <lie/detail/small_matrix.hpp>
#include <lie/manifold.hpp>
#include <stats/detail/ranges.hpp>
#include <stats/gaussian.hpp>
#include <stats/status.hpp>

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <type_traits>
#include <vector>

namespace liestat {

/// The place where weighted residuals vanish.
template <Homogeneous M>
struct MeanAbout {
  M mean = ManifoldTraits<M>::origin();
  SquareOf<M> covariance = SquareOf<M>::Zero();  ///< Σ w z zᵀ / Σ w in the local frame at the mean; any sign
  Status status = Status::not_applicable;
  int iterations = 0;
  double residual = 0;  ///< |Σ w z / Σ w| at the mean, rad, m
};

/// The y near the reference with Σ w_i log(y, x_i) = 0, for weights of any sign with a sum that is not zero. From the
/// reference by y ← exp(y, Σ w z / Σ w), halved as long as that does not shorten the sum. not_applicable: no features,
/// not one weight for each, or their sum is zero or not finite; not_converged: no such y was found in 100 steps.
template <detail::AnyRange R, detail::AnyRange W, class M = detail::SampleInSignature<R>>
MeanAbout<M> meanAbout(R&& features, W&& weights, const std::type_identity_t<M>& reference) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  MeanAbout<M> result;
  result.mean = reference;
  const auto samples = detail::asSamples(features);
  const auto w = detail::asWeights(weights);
  double total = 0, size = 0;
  for (std::size_t i = 0; i < w.size(); ++i) total += w[i], size += std::abs(w[i]);
  // Weights that cancel but for their rounding have no mean.
  const bool usable = std::isfinite(size) && std::abs(total) > 1e-12 * size;
  if (samples.size() == 0 || samples.size() != w.size() || !usable) return result;
  const auto residual = [&](const M& y) {
    const auto to_y = T::placement(y).inverse();
    TangentOf<M> sum = TangentOf<M>::Zero();
    for (std::size_t i = 0; i < w.size(); ++i) sum += S(w[i] / total) * T::logOrigin(T::act(to_y, M(samples[i])));
    return sum;
  };
  result.status = Status::not_converged;
  TangentOf<M> step = residual(reference);
  result.residual = static_cast<double>(step.norm());
  const double eps = static_cast<double>(std::numeric_limits<S>::epsilon());
  const double scale = 1 + static_cast<double>(T::logOrigin(reference).norm());
  const double tolerance = 8 * eps * scale * size / std::abs(total);
  double factor = 1;
  while (result.residual > tolerance && result.iterations < 100 && factor > 1e-6) {
    const M next = exp(result.mean, TangentOf<M>(S(factor) * step));
    const TangentOf<M> there = residual(next);
    const double length = static_cast<double>(there.norm());
    ++result.iterations;
    if (length < result.residual) {
      result.mean = next, step = there, result.residual = length, factor = 1;
    } else {
      factor *= 0.5;
    }
  }
  // At the end rounding decides which of two is shorter.
  if (result.residual <= 100 * tolerance) result.status = Status::ok;
  const auto to_y = T::placement(result.mean).inverse();
  for (std::size_t i = 0; i < w.size(); ++i) {
    const TangentOf<M> z = T::logOrigin(T::act(to_y, M(samples[i])));
    result.covariance += S(w[i] / total) * z * z.transpose();
  }
  return result;
}

/// Points that stand for a normal law, the first of them its mean.
template <Homogeneous M>
struct SigmaPoints {
  static constexpr std::size_t count = 2 * std::size_t(ManifoldTraits<M>::DoF) + 1;
  std::array<M, count> points;
  std::array<double, count> weights{};  ///< their sum is one
};

/// The sigma points of a Gaussian, √c standard deviations from its mean, c > 0. A covariance without a Cholesky factor
/// gives points that are NaN.
template <Homogeneous M>
SigmaPoints<M> sigmaPoints(const Gaussian<M>& gaussian, double c = 3) {
  using S = ScalarOf<M>;
  constexpr int k = ManifoldTraits<M>::DoF;
  SigmaPoints<M> sigma;
  sigma.points.fill(gaussian.mean);
  sigma.weights.fill(0.5 / c);
  sigma.weights[0] = 1 - k / c;
  const SquareOf<M> L = detail::Cholesky<S, k>(gaussian.covariance).lower();
  for (int i = 0; i < k; ++i) {
    const TangentOf<M> v = S(std::sqrt(c)) * L.col(i);
    sigma.points[2 * std::size_t(i) + 1] = exp(gaussian.mean, v);
    sigma.points[2 * std::size_t(i) + 2] = exp(gaussian.mean, TangentOf<M>(-v));
  }
  return sigma;
}

/// The image of a Gaussian.
template <Homogeneous N, int K>
struct UnscentedImage {
  Gaussian<N> estimate;
  /// Covariance of the image's error with that of the argument, each in its local frame: a filter's gain is its
  /// transpose times the inverse of an innovation's covariance.
  Eigen::Matrix<ScalarOf<N>, ManifoldTraits<N>::DoF, K> cross;
  /// not_converged: the image's points have no mean near the middle one's; ill_defined: the negative weight of the
  /// middle leaves a covariance that is none, because the function bends too much within c standard deviations.
  Status status = Status::not_converged;
};

/// Mean, covariance and cross-covariance of f(x), x of the Gaussian, f into any manifold: of polynomials of the third
/// degree the exact mean, in general with an error of the fourth order in the standard deviations.
template <Homogeneous M, class F>
auto unscentedTransform(const Gaussian<M>& gaussian, const F& f, double c = 3) {
  using N = std::decay_t<decltype(f(gaussian.mean))>;
  using T = ManifoldTraits<N>;
  constexpr int k = ManifoldTraits<M>::DoF, d = T::DoF;
  static_assert(std::is_same_v<ScalarOf<M>, ScalarOf<N>>, "liestat: the function keeps the scalar type.");
  const SigmaPoints<M> sigma = sigmaPoints(gaussian, c);
  std::vector<N> images;
  for (const M& x : sigma.points) images.push_back(f(x));
  const MeanAbout<N> mean = meanAbout(images, sigma.weights, images[0]);
  UnscentedImage<N, k> result{{mean.mean, mean.covariance}, Eigen::Matrix<ScalarOf<N>, d, k>::Zero(), mean.status};
  const auto to_mean = T::placement(mean.mean).inverse();
  for (std::size_t i = 1; i < images.size(); ++i) {
    result.cross += ScalarOf<N>(sigma.weights[i]) * T::logOrigin(T::act(to_mean, images[i])) *
                    log(gaussian.mean, sigma.points[i]).transpose();
  }
  // Semidefinite but for rounding: a function may ignore some directions.
  const SquareOf<N> slightly = ScalarOf<N>(1e-9) * result.estimate.covariance.trace() * SquareOf<N>::Identity();
  const bool zero = result.estimate.covariance.isZero(0);
  if (mean.status == Status::ok && !zero &&
      !detail::Cholesky<ScalarOf<N>, d>(SquareOf<N>(result.estimate.covariance + slightly)).ok()) {
    result.status = Status::ill_defined;
  }
  return result;
}

}  // namespace liestat
