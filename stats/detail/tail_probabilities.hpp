// Tail probabilities of Student's, Hotelling's and χ² laws, for estimators that need Eigen alone (stats/laws.hpp has the laws,
// by Boost).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

namespace liestat::detail {

/// The regularised incomplete beta function I_x(a, b), by Lentz's continued fraction; about 1e-14.
inline double incompleteBeta(double a, double b, double x) {
  if (!(x >= 0 && x <= 1)) return std::numeric_limits<double>::quiet_NaN();
  if (x == 0 || x == 1) return x;
  if (x > (a + 1) / (a + b + 2)) return 1 - incompleteBeta(b, a, 1 - x);
  constexpr double tiny = 1e-300;
  const auto away = [](double v) { return std::abs(v) < tiny ? tiny : v; };
  double c = 1, d = 1 / away(1 - (a + b) * x / (a + 1)), fraction = d;
  for (int m = 1; m < 10000; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    d = 1 / away(1 + even * d), c = away(1 + even / c), fraction *= c * d;
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    d = 1 / away(1 + odd * d), c = away(1 + odd / c);
    fraction *= c * d;
    if (std::abs(c * d - 1) < 1e-15) break;
  }
  const double log_front = std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x);
  return std::exp(log_front) * fraction / a;
}

/// P(T > t) of Student's law with the given degrees of freedom.
inline double studentTail(double t, double dof) {
  const double two_sided = incompleteBeta(0.5 * dof, 0.5, dof / (dof + t * t));
  return t > 0 ? 0.5 * two_sided : 1 - 0.5 * two_sided;
}

/// P(T² > t2) of Hotelling's law: k dimensions, covariance from n residuals. NaN for n <= k.
inline double hotellingTail(double t2, int k, double n) {
  if (!(n > k)) return std::numeric_limits<double>::quiet_NaN();
  return incompleteBeta(0.5 * (n - k), 0.5 * k, 1 / (1 + t2 / (n - 1)));
}

/// The x at which a tail probability, which falls from 1 at 0, is `tail`.
template <class Tail>
double whereTail(double tail, const Tail& of) {
  double low = 0, high = 1;
  while (of(high) > tail && high < 1e12) low = high, high *= 2;
  for (int i = 0; i < 50 && high - low > 1e-9 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (of(middle) > tail ? low : high) = middle;
  }
  return high;
}

/// P(χ²ₙ > x), of relative precision some 1e-14 √n also where it is tiny; 1 for n = 0, NaN for NaN.
inline double chiSquaredTail(double x, std::size_t n) {
  if (n == 0 || x <= 0) return 1;
  if (std::isnan(x)) return x;
  if (std::isinf(x)) return 0;
  const double a = 0.5 * static_cast<double>(n), half = 0.5 * x;
  const double front = std::exp(a * std::log(half) - half - std::lgamma(a));
  constexpr double eps = std::numeric_limits<double>::epsilon();
  constexpr int most = 1'000'000;  // terms; some √a are needed where a series is slow
  if (half < a + 1) {
    double term = 1 / a, sum = term;
    for (int m = 1; m < most && term > eps * sum; ++m) term *= half / (a + m), sum += term;
    return std::max(0.0, 1 - front * sum);
  }
  // Lentz's continued fraction of the upper incomplete gamma function.
  double b = half + 1 - a, c = 1e300, d = 1 / b, fraction = d;
  for (int m = 1; m < most; ++m) {
    const double an = -m * (m - a);
    b += 2;
    d = 1 / (an * d + b), c = b + an / c;
    fraction *= c * d;
    if (std::abs(c * d - 1) < eps) break;
  }
  return front * fraction;
}

/// A bound of the probability that the mean of n numbers exceeds x which each follow χ²ₖ, however they depend on each other.
/// The mean is then below χ²ₖ in convex order, so that P(mean > x) ≤ E(χ²ₖ - a)₊ / (x - a) for every a < x; the least of
/// these bounds is about e times P(χ²ₖ > x). Exact for n = 1; 1 for n = 0, NaN for NaN.
inline double dependentMeanTail(double x, std::size_t k, std::size_t n) {
  if (n < 2) return n == 0 ? 1 : chiSquaredTail(x, k);
  const auto dof = static_cast<double>(k);
  // a is best where x - a is the mean excess over a, which is close to 2 far out.
  double best = 1, excess = 2;
  for (int pass = 0; pass < 4 && x > dof + excess; ++pass) {
    const double a = x - excess, above = chiSquaredTail(a, k);
    const double expected = dof * chiSquaredTail(a, k + 2) - a * above;
    best = std::min(best, expected / excess);
    if (!(above > 0 && expected > 0)) break;
    excess = expected / above;
  }
  return std::isnan(x) ? x : best;
}

}  // namespace liestat::detail
