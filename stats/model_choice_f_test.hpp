// The exact F test between nested models, as a rule of stats/model_choice.hpp (needs Boost.Math, Debian: libboost-dev).
//
// Source: T. Viéville, D. Lingrand, F. Gaspard, INRIA RR-4050, 2000, appendix B, (51) to (53), with residual degrees of
// freedom and those of F in their order.
#pragma once

#include <stats/laws.hpp>
#include <stats/model_choice.hpp>

namespace liestat {

/// Φ_P(r, r') = (r/r')/(1 + f δ/r'), f the P-quantile of F with δ = r - r' and r' degrees of freedom: rejects the specific
/// model where ((L² - L²')/δ)/(L²'/r') > f. Exact for Gaussian noise and linear equations. NaN, which rejects nothing,
/// outside 0 < r' < r and 0 <= P <= 1.
struct FTestPhi {
  double probability = 0.999;
  double operator()(double r, double r_general) const {
    if (!(r_general > 0 && r > r_general)) return detail::not_a_number;
    const double f = detail::lawQuantile(detail::FisherLaw(r - r_general, r_general), probability);
    return (r / r_general) / (1 + f * (r - r_general) / r_general);
  }
};

}  // namespace liestat
