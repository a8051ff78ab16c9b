// The scatter S in the covariance H⁻¹ W S W H⁻¹ of a mean from residuals, and the number of measurements for
// Hotelling's law, by the meaning of the weights.
//
// Weights that are no inverse variances leave fewer degrees of freedom than measurements: with leverages h_i = p_i/Σp
// the effective number is 1/Σh² = (Σp)²/Σp². The residual of a measurement of leverage h is too short by 1 - h about,
// which the jackknife's S = Σ (p_i/(1 - h_i))² z_i z_iᵀ mends; its own degrees of freedom after Satterthwaite, tr²G/tr
// G² of the quadratic form, are fewer than 1/Σh² - 1 where some weights dominate, and by themselves too cautious: their
// geometric mean, four parts to one, holds 93 to 97 % at ln-sd 1 and 2, 1 to 3 dimensions, from an effective number of
// eight on (docs/theory/means.md, section 3.5).
#pragma once

#include <lie/manifold.hpp>
#include <stats/covariance.hpp>
#include <stats/mean.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace liestat::detail {

template <Homogeneous M>
struct ResidualScatter {
  SquareOf<M> scatter = SquareOf<M>::Zero();
  double n = 0;                  ///< for Hotelling's law
  const char* reason = nullptr;  ///< why there is no covariance, where the weights leave too little
};

/// Fewer measurements of equal weight, in effect, have no covariance under ResidualNoise::any.
inline constexpr double min_effective_n = 8;
inline constexpr const char* few_effective_reason =
    "the weights leave less than eight measurements of equal weight in effect: no law of the errors is known";

/// The degrees of freedom of the jackknife's scatter of one coordinate; see above.
template <class W>
double jackknifeFreedom(const W& weights, std::size_t n, double sum, double effective_n) {
  const double s2 = 1 / effective_n;
  double c0 = 0, c1 = 0, c2 = 0, trace = 0, diagonal = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double h = static_cast<double>(weights[i]) / sum, c = h * h / ((1 - h) * (1 - h));
    const double own = 1 - 2 * h + s2, other = s2 - 2 * h;  // of (I - 1hᵀ)(I - 1hᵀ)ᵀ
    c0 += c, c1 += c * h, c2 += c * h * h;
    trace += c * own, diagonal += c * c * (own * own - other * other);
  }
  const double off = s2 * s2 * c0 * c0 + 2 * c0 * c2 + 2 * c1 * c1 - 4 * s2 * c0 * c1;
  const double most = effective_n - 1, satterthwaite = std::min(most, trace * trace / (off + diagonal));
  return std::pow(most, 0.8) * std::pow(satterthwaite, 0.2);
}

/// `sums` is the mean's last pass: its n, sum_of_weights and scatter.
template <Homogeneous M, class R, class W, class Sums>
ResidualScatter<M> residualScatter(const R& samples, const W& weights, const Sums& sums, ResidualNoise noise) {
  using T = ManifoldTraits<M>;
  using S = ScalarOf<M>;
  ResidualScatter<M> result;
  const double n = static_cast<double>(sums.n), sum = static_cast<double>(sums.sum_of_weights);
  if (noise == ResidualNoise::scaled) {
    result.n = n;
    result.scatter = sums.scatter * (S(sum) / (S(sums.n) - S(1)));
  } else if (noise == ResidualNoise::frequency) {
    result.n = sum;
    result.scatter = sums.scatter * S(sum / (sum - 1));
    if (!(sum > T::DoF)) result.reason = "a covariance from residuals needs more features than their dimension";
  } else {
    double squares = 0;
    for (std::size_t i = 0; i < sums.n; ++i) {
      const double p = static_cast<double>(weights[i]);
      squares += p * p;
    }
    const double effective_n = sum * sum / squares;
    if (!(effective_n >= min_effective_n)) {
      result.reason = few_effective_reason;
      return result;
    }
    const typename T::Group to_mean = T::placement(sums.mean).inverse();
    for (std::size_t i = 0; i < sums.n; ++i) {
      const double p = static_cast<double>(weights[i]);
      const TangentOf<M> z = S(p / (1 - p / sum)) * T::logOrigin(T::act(to_mean, M(samples[i])));
      result.scatter += z * z.transpose();
    }
    result.n = 1 + jackknifeFreedom(weights, sums.n, sum, effective_n);
    if (!(result.n > T::DoF)) result.reason = few_effective_reason;
  }
  return result;
}

}  // namespace liestat::detail
