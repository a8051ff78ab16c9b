// The fit of measurements to the noise that is stated for them: a hypothesis, which their scatter tests before it
// enters a covariance or a verdict. (Needs the standard library alone.)
//
// χ² = min over y of Σ r_iᵀ V_i⁻¹ r_i, r_i = log(y, x_i), follows χ² of k (n - 1) degrees of freedom where the stated
// covariances V_i are right. It is the minimum that follows this law: the sum about a least-squares mean does not where
// the V_i differ, nor does that after one step (docs/uniqueness.md, "Stated noise is tested").
#pragma once

#include <stats/detail/tail_probabilities.hpp>

#include <algorithm>
#include <cstddef>

namespace liestat {

/// The level of every verdict by χ²: stated noise is refuted by a fit that is less probable.
inline constexpr double refutation_level = 1e-3;
/// Below this p a result says by which factor its stated covariances are too small, although it is not refuted: with
/// few measurements the test has little power (of three rotations it sees half the true deviation in 46 of 100 cases).
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

/// The fate of a covariance whose stated noise is refuted.
enum class RefutedNoise {
  withheld,  ///< there is none: status inconsistent
  residuals  ///< it is computed from the residuals, as if no noise had been stated
};

}  // namespace liestat
