// Quantiles for the verdicts of the motion filters, without a library of distributions: they decide about frames, and
// a per mille of a probability is of no matter there.
#pragma once

#include <cmath>
#include <numbers>

namespace liestat::detail {

/// The z that a standard normal variable exceeds with this probability, by Newton's method on the complementary error
/// function. NaN outside (0, 1).
inline double normalThreshold(double probability) {
  if (!(probability > 0 && probability < 1)) return std::nan("");
  double z = 0;
  for (int i = 0; i < 60; ++i) {
    const double tail = 0.5 * std::erfc(z / std::numbers::sqrt2);
    const double density = std::exp(-0.5 * z * z) / std::sqrt(2 * std::numbers::pi);
    const double step = (tail - probability) / density;
    z += step > 1 ? 1 : step < -1 ? -1 : step;
    if (std::abs(step) < 1e-12) break;
  }
  return z;
}

/// The value that χ² of k degrees of freedom exceeds about as often as a standard normal variable exceeds z (E. Wilson
/// and M. Hilferty, PNAS 17, 1931); within 1 % from three degrees of freedom on.
inline double chiSquaredBound(double k, double z) {
  const double c = 2 / (9 * k), root = 1 - c + z * std::sqrt(c);
  return k * root * root * root;
}

}  // namespace liestat::detail
