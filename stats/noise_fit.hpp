// The fit of measurements to the noise that is stated for them: a hypothesis, which their scatter tests before it enters a
// covariance or a verdict. Needs Eigen alone.
//
// χ² = min over y of Σ r_iᵀ V_i⁻¹ r_i, r_i = log(y, x_i), follows χ² of k (n - 1) degrees of freedom where the stated
// covariances V_i are right. It is the minimum that follows this law: the sum about a least-squares mean does not where
// the V_i differ, nor does that after one step (docs/theory/means.md, section 5.3).
#pragma once

#include <lie/manifold.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/detail/packing.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/executor.hpp>
#include <stats/gaussian.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <span>
#include <vector>

namespace liestat {

/// The level of every verdict by χ²: stated noise is refuted by a fit that is less probable.
inline constexpr double refutation_level = 1e-3;
/// Below this p a result says by which factor its stated covariances are too small, although it is not refuted: with few
/// measurements the test has little power (of three rotations it sees half the true deviation in 46 of 100 cases).
inline constexpr double doubtful_fit = 0.05;

/// The χ² of measurements under their stated noise.
struct NoiseFit {
  double chi2 = 0;
  double degrees_of_freedom = 0;  ///< k (n - 1); 0: nothing was tested, as of a single measurement
  double p = 1;                   ///< probability of so large a χ²; NaN where χ² is

  bool tested() const { return degrees_of_freedom > 0; }
  /// The stated noise does not explain the scatter. What can't be computed explains nothing.
  bool refuted(double level = refutation_level) const { return tested() && level > 0 && !(p >= level); }
  /// Birge's factor max(1, χ²/ν): by it the stated covariances are too small if all are so by the same factor.
  double factor() const { return tested() ? std::max(1.0, chi2 / degrees_of_freedom) : 1; }

  static NoiseFit of(double chi2, double degrees_of_freedom) {
    if (!(degrees_of_freedom > 0)) return {};
    return {chi2, degrees_of_freedom, detail::chiSquaredTail(chi2, static_cast<std::size_t>(degrees_of_freedom))};
  }
};

/// What becomes of a covariance whose stated noise is refuted.
enum class RefutedNoise {
  withheld,  ///< there is none: status inconsistent
  residuals  ///< it is computed from the residuals, as if no noise had been stated
};

namespace detail {

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

/// The inverse of a stated covariance; of a singular one that of the covariance with some 1e-6 of its largest deviation,
/// and at least 1e-12, in every direction. Not finite for what is no covariance.
template <class S, int N>
Eigen::Matrix<S, N, N> statedInformation(const Eigen::Matrix<S, N, N>& covariance) {
  const Cholesky<S, N> factor(covariance);
  if (factor.ok()) return factor.inverse();
  const S least = std::max(S(1e-12) * covariance.trace(), S(1e-24));
  return Cholesky<S, N>(covariance + least * Eigen::Matrix<S, N, N>::Identity()).inverse();
}

/// The fit to `noise`: one covariance for each of the samples, in the frame there, or one for all in that of `y`, carried
/// to the estimate as transport() does. Gauss-Newton's iteration from y, a mean of the same samples.
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

}  // namespace detail
}  // namespace liestat
