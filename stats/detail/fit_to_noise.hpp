// The fit of measurements to their stated noise (stats/noise_fit.hpp), for a mean that is not the minimum of its χ².
#pragma once

#include <lie/manifold.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/detail/packing.hpp>
#include <stats/executor.hpp>
#include <stats/gaussian.hpp>
#include <stats/noise_fit.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <ranges>
#include <span>
#include <vector>

namespace liestat::detail {

template <Homogeneous M>
struct NoiseFitSums {
  double chi2 = 0;
  TangentOf<M> gradient = TangentOf<M>::Zero();
  SquareOf<M> information = SquareOf<M>::Zero();

  void operator+=(const NoiseFitSums& other) {
    chi2 += other.chi2;
    gradient += other.gradient;
    information += other.information;
  }
  std::vector<double> pack() const { return packed(chi2, gradient, information); }
  static NoiseFitSums unpack(std::span<const double> list) {
    NoiseFitSums s;
    unpackInto(list, s.chi2, s.gradient, s.information);
    return s;
  }
};

/// The inverse of a stated covariance; of a singular one that of the covariance with some 1e-6 of its largest
/// deviation, and at least 1e-12, in every direction. Not finite for what is no covariance.
template <class S, int N>
Eigen::Matrix<S, N, N> statedInformation(const Eigen::Matrix<S, N, N>& covariance) {
  const Cholesky<S, N> factor(covariance);
  if (factor.ok()) return factor.inverse();
  const S least = std::max(S(1e-12) * covariance.trace(), S(1e-24));
  return Cholesky<S, N>(covariance + least * Eigen::Matrix<S, N, N>::Identity()).inverse();
}

/// The fit to `noise`: one covariance for each of the samples, in the frame there, or one for all in that of `y`,
/// carried to the estimate as transport() does. Gauss-Newton's iteration from y, a mean of the same samples.
template <Homogeneous M, Executor E, class R>
NoiseFit fitToNoise(const E& executor, const R& samples, const std::vector<SquareOf<M>>& noise, M y) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  // On a sphere the carried covariance turns as the estimate moves; seen from the sample it stands still.
  constexpr bool from_samples = T::Group::DoF != T::DoF && !Factored<M>;
  constexpr bool carried = !from_samples && !HasTrivialIsotropy<M>;
  const std::size_t n = std::ranges::size(samples);
  if (n < 2 || noise.empty()) return {};
  const bool common = noise.size() == 1;
  const M first = y;
  std::vector<SquareOf<M>> information;
  if (from_samples && common) {
    for (std::size_t i = 0; i < n; ++i) {
      information.push_back(
          statedInformation<S, T::DoF>(transport(Gaussian<M>{y, noise[0]}, M(samples[i])).covariance));
    }
  } else {
    for (const SquareOf<M>& v : noise) information.push_back(statedInformation<S, T::DoF>(v));
  }
  const auto sums_at = [&](const M& at) {
    return sumOverData<NoiseFitSums<M>>(executor, n, [&](std::size_t i, NoiseFitSums<M>& s) {
      const M& x = samples[i];
      const ErrorVector<M> e = from_samples ? errorVector(x, at) : errorVector(at, x);
      const SquareOf<M>& J = from_samples ? e.by_feature : e.by_base;
      SquareOf<M> B = information[information.size() == 1 ? 0 : i];
      if constexpr (carried) B = congruence(frameTransport(common ? first : x, at), B);
      const SquareOf<M> weighted = product(J.transpose(), B);
      s.chi2 += static_cast<double>(e.z.dot(B * e.z));
      s.gradient += weighted * e.z;
      s.information += product(weighted, J);
    });
  };
  // A χ² to one part in a million of its standard deviation is as good as the minimum.
  constexpr int max_steps = 30;
  const double dof = T::DoF * (static_cast<double>(n) - 1), enough = 1e-6 * std::sqrt(2 * dof);
  NoiseFitSums<M> sums = sums_at(y);
  for (int i = 0; i < max_steps; ++i) {
    TangentOf<M> step = -Cholesky<S, T::DoF>(sums.information).solve(sums.gradient);
    if (!(static_cast<double>(-step.dot(sums.gradient)) > enough)) break;
    bool decreased = false;
    for (int halving = 0; halving < 8 && !decreased; ++halving, step *= S(0.5)) {
      const M next = exp(y, step);
      const NoiseFitSums<M> next_sums = sums_at(next);
      decreased = next_sums.chi2 < sums.chi2;
      if (decreased) y = next, sums = next_sums;
    }
    if (!decreased) break;
  }
  return NoiseFit::of(sums.chi2, dof);
}

}  // namespace liestat::detail
