#pragma once

// The law of the two-sided Kolmogorov-Smirnov statistic D_n = sup |F_n(x) - F(x)|, F continuous (needs the standard
// library alone). With x = d √n:
//
// - x² < 4, n ≤ 2000: exact. Durbin's matrix as in G. Marsaglia, W. W. Tsang, J. Wang, "Evaluating Kolmogorov's
//   distribution", J. Stat. Software 8(18), 2003, applied to a vector n times, all terms positive. Relative error of
//   the probability below 2e-13.
// - x² < 4, n > 2000: four terms of the expansion in 1/√n of W. Pelz, I. J. Good, "Approximating the lower tail
//   areas of the Kolmogorov-Smirnov one-sample statistic", J. R. Stat. Soc. B 38, 1976. Absolute error below 0.055/n²,
//   that is 1.4e-8 (measured against the exact law up to n = 16000).
// - x² ≥ 4 or d ≥ 1/2: twice Smirnov's one-sided tail, so that tiny p-values keep their relative precision: 4e-11 for
//   n ≤ 10⁵, where exp(-6x²) is the neglected event that both sides exceed d (none for d ≥ 1/2), 2e-6 beyond.
//
// The choice of methods is discussed in R. Simard, P. L'Ecuyer, "Computing the two-sided Kolmogorov-Smirnov
// distribution", J. Stat. Software 39(11), 2011.

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <limits>
#include <ranges>
#include <vector>

namespace liestat {

namespace detail {

/// Both ends of the law: whichever is small has been computed directly, not as one minus the other.
struct KolmogorovTails {
  double cdf;
  double survival;
};

/// Largest n for which Durbin's matrix is used: the work grows with n^(3/2), a few milliseconds here, and the expansion
/// is accurate enough beyond.
inline constexpr std::size_t kolmogorov_exact_limit = 2000;

/// P(D_n ≤ d) by Durbin's matrix H (Marsaglia, Tsang and Wang 2003): n!/n^n times the middle element of H^n.
inline double kolmogorovDurbin(std::size_t n, double d) {
  const double nd = static_cast<double>(n) * d;
  const auto k = static_cast<std::size_t>(nd) + 1;
  const std::size_t m = 2 * k - 1;
  const double h = static_cast<double>(k) - nd;

  // H is 1/(i - j + 1)! at (i, j) for j ≤ i + 1, but for its first column and last row. Terms beyond 1/40! are below
  // any rounding, because all entries and all elements of the vector are positive and neighbours are comparable.
  constexpr std::size_t max_factorial = 40;
  const std::size_t size = std::max(m, max_factorial) + 2;
  std::vector<double> inverse_factorial(size);
  inverse_factorial[0] = 1;
  for (std::size_t i = 1; i < size; ++i) inverse_factorial[i] = inverse_factorial[i - 1] / static_cast<double>(i);

  // First column (i - 0 + 1)!; the last row is its mirror image, and the corner has both corrections.
  std::vector<double> first(m);
  double power = 1;
  for (std::size_t i = 0; i < m; ++i) {
    power *= h;
    first[i] = (1 - power) * inverse_factorial[i + 1];
  }
  const double corner_gain = 2 * h > 1 ? std::pow(2 * h - 1, static_cast<double>(m)) : 0;
  const double corner = (1 - 2 * power + corner_gain) * inverse_factorial[m];
  first[m - 1] = corner;

  std::vector<double> v(m, 0.), next(m);
  v[k - 1] = 1;
  int exponent = 0;
  for (std::size_t step = 1; step <= n; ++step) {
    // The factor step/n makes up n!/n^n in the end; powers of two keep the numbers away from the ends of the range.
    const double factor = static_cast<double>(step) / static_cast<double>(n);
    double largest = 0;
    for (std::size_t i = 0; i + 1 < m; ++i) {
      double sum = first[i] * v[0];
      for (std::size_t j = i + 1 > max_factorial ? i + 1 - max_factorial : 1; j <= i + 1; ++j) {
        sum += inverse_factorial[i + 1 - j] * v[j];
      }
      next[i] = sum * factor;
      largest = std::max(largest, next[i]);
    }
    double last = corner * v[0];
    for (std::size_t j = 1; j < m; ++j) last += first[m - 1 - j] * v[j];
    next[m - 1] = last * factor;
    largest = std::max(largest, next[m - 1]);
    v.swap(next);
    if (largest < 0x1p-500 || largest > 0x1p+500) {
      const int shift = std::ilogb(largest);
      for (double& value : v) value = std::ldexp(value, -shift);
      exponent += shift;
    }
  }
  return std::ldexp(v[k - 1], exponent);
}

/// P(D_n ≤ x/√n) by the expansion of Pelz and Good, four terms.
inline double kolmogorovPelzGood(std::size_t n, double x) {
  constexpr double half_turn = 3.14159265358979323846;
  const double x2 = x * x, x4 = x2 * x2, x6 = x4 * x2, x8 = x4 * x4;
  const double root_half_pi = std::sqrt(half_turn / 2);
  double s0 = 0, s1 = 0, s2 = 0, s3 = 0, t2 = 0, t3 = 0;
  // Sums over all integers k of functions of (k + 1/2)² and of k²; both are even, so k ≥ 0 counts twice.
  for (int k = 0; k < 200; ++k) {
    const double half2 = half_turn * half_turn * (k + 0.5) * (k + 0.5), whole2 = half_turn * half_turn * k * k;
    const double e = std::exp(-half2 / (2 * x2)), f = std::exp(-whole2 / (2 * x2));
    if (k > 0 && f < 1e-30) break;
    const double half4 = half2 * half2, half6 = half4 * half2;
    s0 += 2 * e;
    s1 += 2 * e * (half2 - x2);
    s2 += 2 * e * (6 * x6 + 2 * x4 + half2 * (2 * x4 - 5 * x2) + half4 * (1 - 2 * x2));
    s3 += 2 * e *
          (half6 * (5 - 30 * x2) + half4 * (-60 * x2 + 212 * x4) + half2 * (135 * x4 - 96 * x6) - (30 * x6 + 90 * x8));
    t2 += 2 * f * whole2;
    t3 += 2 * f * (3 * whole2 * x2 - whole2 * whole2);
  }
  const double k0 = root_half_pi / x * s0;
  const double k1 = root_half_pi / (6 * x4) * s1;
  const double k2 = root_half_pi * (s2 / (72 * x6 * x) - t2 / (36 * x2 * x));
  const double k3 = root_half_pi * (s3 / (6480 * x8 * x2) + t3 / (216 * x6));
  const double root_n = std::sqrt(static_cast<double>(n));
  return k0 + (k1 + (k2 + k3 / root_n) / root_n) / root_n;
}

/// log(j!) - log(√(2πj) (j/e)^j), the error of Stirling's formula, j ≥ 1.
inline double stirlingError(double j) {
  if (j < 16) {
    double factorial = 1;
    for (double i = 2; i <= j; ++i) factorial *= i;
    constexpr double half_log_two_pi = 0.91893853320467274178;
    return std::log(factorial) - (j + 0.5) * std::log(j) + j - half_log_two_pi;
  }
  const double r = 1 / (j * j);
  return (1. / 12 - r * (1. / 360 - r * (1. / 1260 - r * (1. / 1680 - r / 1188)))) / j;
}

/// P(sup (F_n - F) > d), Smirnov's finite sum for n ≤ 10⁵, an expansion of its logarithm beyond.
inline double smirnovTail(std::size_t size, double d) {
  const auto n = static_cast<double>(size);
  if (size > 100000) {
    // Measured against the sum: the relative error is 1.6/n^(3/2) at d√n = 2 and 57/n^(3/2) at d√n = 6.
    const double x2 = n * d * d;
    return std::exp(-2 * x2 - 2 * d / 3 + 4 * x2 * (1 - x2) / (9 * n));
  }
  // The sum over j of d/(d + j/n) times the binomial probability of j successes in n with p = d + j/n, the latter in
  // saddle-point form, where nothing large cancels.
  double sum = std::exp(n * std::log1p(-d));
  const double nd = n * d;
  const double stirling_n = stirlingError(n);
  constexpr double two_pi = 6.28318530717958647693;
  for (double j = 1; j + nd < n; ++j) {
    const double rest = n - j;
    const double exponent = j * std::log1p(nd / j) + rest * std::log1p(-nd / rest);
    if (exponent < -745) {
      // The exponent is concave in j with its maximum before the middle of (0, n - nd): beyond it, nothing more comes.
      if (2 * j > n - nd) break;
      continue;
    }
    const double binomial =
        std::sqrt(n / (two_pi * j * rest)) * std::exp(exponent + (stirling_n - stirlingError(j) - stirlingError(rest)));
    sum += d / (d + j / n) * binomial;
  }
  return sum;
}

inline KolmogorovTails kolmogorovTails(std::size_t n, double d) {
  if (n == 0 || std::isnan(d)) {
    return {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};
  }
  const auto size = static_cast<double>(n);
  if (d * size <= 0.5) return {0, 1};
  if (d >= 1) return {1, 0};
  const double x2 = size * d * d;
  if (x2 >= 4 || d >= 0.5) {
    const double survival = std::min(1., 2 * smirnovTail(n, d));
    return {1 - survival, survival};
  }
  double cdf = n <= kolmogorov_exact_limit ? kolmogorovDurbin(n, d) : kolmogorovPelzGood(n, std::sqrt(x2));
  cdf = std::clamp(cdf, 0., 1.);
  return {cdf, 1 - cdf};
}

}  // namespace detail

/// P(D_n ≤ d). 0 for d ≤ 1/(2n), 1 for d ≥ 1; NaN for n = 0 or d = NaN. See the head of this file for the accuracy.
inline double kolmogorovCdf(std::size_t n, double d) { return detail::kolmogorovTails(n, d).cdf; }

/// P(D_n > d), the p-value of a statistic d, accurate to relative precision also where it is tiny. NaN for n = 0 or
/// d = NaN.
inline double kolmogorovPValue(std::size_t n, double d) { return detail::kolmogorovTails(n, d).survival; }

/// D = sup |F_n(x) - F(x)| of a sample in ascending order against the continuous distribution function `cdf`
/// (a callable double -> double). NaN for an empty sample, and if any cdf(x) is NaN.
template <std::ranges::forward_range Sample, class Cdf>
double ksStatistic(const Sample& sorted, Cdf&& cdf) {
  assert(std::ranges::is_sorted(sorted));
  const auto n = static_cast<double>(std::ranges::distance(sorted));
  if (n == 0) return std::numeric_limits<double>::quiet_NaN();
  double statistic = 0, below = 0;
  for (const auto& x : sorted) {
    const double p = cdf(x);
    if (std::isnan(p)) return p;
    statistic = std::max({statistic, p - below / n, (below + 1) / n - p});
    ++below;
  }
  return statistic;
}

/// The outcome of a Kolmogorov-Smirnov test.
struct KsTest {
  double statistic = std::numeric_limits<double>::quiet_NaN();  ///< D, see ksStatistic
  double p_value = std::numeric_limits<double>::quiet_NaN();    ///< probability of a larger D under the law tested
  std::size_t n = 0;                                            ///< size of the sample
};

/// Kolmogorov-Smirnov test of a sample (any order) against a continuous distribution function that was not fitted to
/// it. An empty sample or a NaN in it gives NaN.
template <std::ranges::input_range Sample, class Cdf>
KsTest ksTest(const Sample& sample, Cdf&& cdf) {
  std::vector<double> sorted;
  for (const auto& x : sample) sorted.push_back(static_cast<double>(x));
  KsTest result;
  result.n = sorted.size();
  if (std::ranges::any_of(sorted, [](double x) { return std::isnan(x); })) return result;
  std::ranges::sort(sorted);
  result.statistic = ksStatistic(sorted, cdf);
  result.p_value = kolmogorovPValue(result.n, result.statistic);
  return result;
}

}  // namespace liestat
