// The upper tail of χ² with a whole number of degrees of freedom, without Boost.
#pragma once

#include <cmath>
#include <cstddef>

namespace liestat::detail {

/// P(χ²ₙ > x) for x that is not too far out for a number (then 0); 1 for n = 0, NaN for NaN.
inline double chiSquaredTail(double x, std::size_t n) {
  if (n == 0 || x <= 0) return 1;
  // Q(x, n + 2) = Q(x, n) + (x/2)^(n/2) exp(-x/2) / Γ(n/2 + 1).
  const double half = 0.5 * x;
  const bool odd = n % 2 == 1;
  double tail = odd ? std::erfc(std::sqrt(half)) : std::exp(-half);
  double log_factorial = odd ? std::lgamma(1.5) : 0;  // of k/2
  for (std::size_t k = odd ? 1 : 2; k < n; k += 2) {
    const double power = 0.5 * static_cast<double>(k);
    if (k > 2) log_factorial += std::log(power);
    tail += std::exp(power * std::log(half) - half - log_factorial);
  }
  return tail;
}

}  // namespace liestat::detail
