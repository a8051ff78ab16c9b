// The covariance of a Mahalanobis mean from the Hessian averaged over the region that this covariance says: what
// stats/detail/settled_covariance.hpp does for a Fréchet mean.
#pragma once

#include <lie/detail/small_eigen.hpp>
#include <stats/detail/angular_part.hpp>
#include <stats/detail/settled_covariance.hpp>
#include <stats/detail/mahalanobis_mean.hpp>

#include <cmath>
#include <cstddef>
#include <ranges>
#include <span>
#include <vector>

namespace liestat::detail {

template <Homogeneous M>
struct SettledMaha {
  SquareOf<M> covariance, factor;
  double change = 0;  ///< relative change of the Hessian
  bool settled = false;
};

template <Homogeneous M, Executor E, class R>
SettledMaha<M> settleMaha(const E& executor, const R& samples, CovarianceAt at, bool likelihood,
                          const MahaResult<M>& result, double largest_change,
                          std::span<const SquareOf<M>> factors = {}) {
  using S = ScalarOf<M>;
  constexpr int D = ManifoldTraits<M>::DoF;
  constexpr auto angular = angularCoordinates<M>();
  constexpr int K = angular.count;
  SettledMaha<M> settled{result.covariance, result.factor, 0, true};
  // A single measurement is its own mean, with the covariance that it came with.
  if (std::ranges::size(samples) == 1) return settled;
  if constexpr (K > 0) {
    using Derivative = Eigen::Matrix<double, D, K>;
    using Matrix = Eigen::Matrix<double, D, D>;
    const std::size_t n = std::ranges::size(samples), stride = (n + max_averaged - 1) / max_averaged;
    std::vector<Gaussian<M>> some;
    std::vector<SquareOf<M>> some_factors;
    std::vector<M> features;
    features.reserve(n);
    for (std::size_t i = 0; i < n; ++i) {
      if (i % stride == 0) some.push_back(samples[i]);
      if (i % stride == 0 && !factors.empty()) some_factors.push_back(factors[i]);
      features.push_back(Gaussian<M>(samples[i]).mean);
    }
    MahaProblem<M, std::vector<Gaussian<M>>> problem{some, at, likelihood, some_factors};
    for (const Gaussian<M>& g : some) problem.append(g.mean, Cholesky<S, D>(g.covariance));
    const double scale = static_cast<double>(n) / static_cast<double>(some.size());
    const double clearance = angleToCutLocus(features, result.mean);
    Matrix at_mean = result.hessian.template cast<double>();
    if (stride > 1) {
      at_mean = problem.hessian(executor, result.mean, problem.evaluate(executor, result.mean)).template cast<double>();
    }
    for (int i = 0; i < 20; ++i) {
      settled.settled = false;
      const auto L = angularRegion<K>(settled.covariance, angular, averaging_width);
      if (!L.allFinite()) return settled;
      if (clearance > cut_locus_margin * reachOf<K>(L)) {
        settled.settled = true;
        return settled;
      }
      const Derivative derivative = averagedDerivative<D, K>(L, [&](const Eigen::Matrix<double, K, 1>& v) {
        TangentOf<M> step = TangentOf<M>::Zero();
        for (int k = 0; k < K; ++k) step[angular.index[static_cast<std::size_t>(k)]] = static_cast<S>(v[k]);
        const M y = exp(result.mean, step);
        const TangentOf<M> gradient = problem.evaluate(executor, y).gradient;
        return Eigen::Matrix<double, D, 1>(
            (frameTransport(result.mean, y).transpose() * gradient).template cast<double>());
      });
      Matrix averaged = result.hessian.template cast<double>();
      for (int k = 0; k < K; ++k) {
        const int c = angular.index[static_cast<std::size_t>(k)];
        for (int r = 0; r < D; ++r) averaged(r, c) += scale * (derivative(r, k) - at_mean(r, c));
      }
      for (int a = 0; a < K; ++a) {
        const int c = angular.index[static_cast<std::size_t>(a)];
        for (int r = 0; r < D; ++r) {
          bool both = false;
          for (int b = 0; b < K; ++b) both = both || angular.index[static_cast<std::size_t>(b)] == r;
          if (!both) averaged(c, r) = averaged(r, c);
        }
      }
      averaged = 0.5 * (averaged + averaged.transpose()).eval();
      // In the axes of the result, in which small variances keep their digits.
      const Matrix axes = result.axes.template cast<double>(),
                   hessian = result.relative_hessian.template cast<double>();
      const Matrix change = averaged - result.hessian.template cast<double>();
      averaged = symmetricPart(Matrix(hessian + axes.transpose() * change * axes));
      const Cholesky<double, D> factor(hessian);
      const Matrix relative = factor.halfSolve(Matrix(factor.halfSolve(averaged).transpose()));
      if (!relative.allFinite()) return settled;
      settled.change = 1 - SymmetricEigen(relative).values[0];
      if (!(settled.change <= largest_change)) return settled;
      settled.factor = covarianceFactor<double, D>(axes, averaged, likelihood).template cast<S>();
      const SquareOf<M> next = squareOfFactor<S, D>(settled.factor);
      if (!next.allFinite()) return settled;
      const double step = static_cast<double>((next - settled.covariance).norm());
      const double size = static_cast<double>(settled.covariance.norm());
      settled.covariance = next;
      if (step <= 0.02 * size) {
        settled.settled = true;
        return settled;
      }
    }
    settled.settled = false;
  }
  return settled;
}

/// True if measurements with their noise show that there is a mean. Neither few of them whose noise and scatter are
/// below a quarter of the uniform law's nor a single one need to.
template <Homogeneous M, class R>
bool showAMean(const R& samples, const M& y) {
  const std::size_t n = std::ranges::size(samples);
  if (n == 1) return true;
  std::vector<M> features;
  std::vector<double> weights;
  SquareOf<M> noise = SquareOf<M>::Zero();
  for (const Gaussian<M>& g : samples) {
    features.push_back(g.mean);
    weights.push_back(static_cast<double>(scalarWeight(g.covariance)));
    noise += g.covariance / ScalarOf<M>(n);
  }
  const Concentration found = angularConcentration<M>(features, weights, y);
  return found.concentrated || (found.isModest() && isModestAngularNoise<M>(noise));
}

}  // namespace liestat::detail
