// The logarithm of a unit quaternion without an inverse trigonometric function: with w the absolute value of its real
// part and u its vector part, the rotation vector is ±f(w) u, f(w) = 2 acos(w)/√(1-w²), which is analytic on [0, 1];
// its nearest singularity lies at -1. One polynomial holds from no rotation to the half-turn, without a branch.
#pragma once

#include <lie/detail/trig.hpp>

#include <array>
#include <cstddef>

namespace liestat::detail {

/// Half of f from σ = (1-w)/2 in [0, ½], φ/sin φ = Σ c_n σⁿ for w = cos φ, c_{n+1}/c_n = (2n+2)/(2n+3); and its
/// derivatives with respect to -w: the first is g.
constexpr long double arccosineSeries(long double sigma, int derivative) {
  long double c = 1, power = 1, sum = derivative == 0 ? 1 : 0;
  for (int n = 1; n < 80; ++n) {
    c *= static_cast<long double>(2 * n) / static_cast<long double>(2 * n + 1);
    long double factor = 1;
    for (int d = 0; d < derivative; ++d) factor *= static_cast<long double>(n - d) / 2;
    if (n > derivative) power *= sigma;
    const long double term = factor * c * power;
    if (n >= derivative) sum += term;
    if (n > 2 * derivative && term < 1e-22L * sum) break;
  }
  return sum;
}

/// The polynomial that interpolates a function of σ at Chebyshev's points of 0 <= σ <= range, in x = 2σ/range - 1;
/// lowest power first.
template <std::size_t N, class Function>
constexpr std::array<double, N> interpolatingPolynomial(Function function, long double range) {
  std::array<long double, N> value{}, node{};
  for (std::size_t i = 0; i < N; ++i) {
    const long double angle = 3.141592653589793238462643383279502884L * static_cast<long double>(2 * i + 1) / (2 * N);
    long double term = 1, cosine = 1;
    for (int k = 1; k < 24; ++k) {
      term *= -angle * angle / static_cast<long double>((2 * k - 1) * (2 * k));
      cosine += term;
    }
    node[i] = cosine;
    value[i] = function(range * (1 + cosine) / 2);
  }
  std::array<long double, N> sum{}, T{}, T_next{}, t{}, t_next{};
  T[0] = 1;                                                           // T_j by its powers of x
  T_next[1] = 1;                                                      // T_{j+1}
  for (std::size_t i = 0; i < N; ++i) t[i] = 1, t_next[i] = node[i];  // their values at the nodes
  for (std::size_t j = 0; j < N; ++j) {
    long double a = 0;
    for (std::size_t i = 0; i < N; ++i) a += value[i] * t[i] * (j == 0 ? 1 : 2) / N;
    for (std::size_t k = 0; k < N; ++k) sum[k] += a * T[k];
    const auto T_j = T, t_j = t;
    T = T_next, t = t_next;
    for (std::size_t k = 0; k < N; ++k) T_next[k] = (k > 0 ? 2 * T[k - 1] : 0) - T_j[k];
    for (std::size_t i = 0; i < N; ++i) t_next[i] = 2 * node[i] * t[i] - t_j[i];
  }
  std::array<double, N> c{};
  for (std::size_t k = 0; k < N; ++k) c[k] = static_cast<double>(sum[k]);
  return c;
}

/// The polynomial of `factor` times the series or one of its derivatives.
template <std::size_t N>
constexpr std::array<double, N> arccosinePolynomial(int derivative, long double factor, long double range) {
  return interpolatingPolynomial<N>([=](long double sigma) { return factor * arccosineSeries(sigma, derivative); },
                                    range);
}

/// Terms that reach the rounding of S: the series converge with the distance from -1, by a factor of 5.8 for each term.
/// Scalars that carry derivatives take a few more, for at the ends of its range the derivative of a polynomial is in
/// error by as much as the square of its degree.
template <class S>
inline constexpr std::size_t arccosine_terms = is_single_precision<S>      ? 11
                                               : std::is_same_v<S, double> ? 21
                                                                           : 24;

/// f(w) for w in [0, 1], and a little beyond.
template <class S>
inline S arccosineRatio(const S& w) {
  static constexpr auto coefficients = arccosinePolynomial<arccosine_terms<S>>(0, 2, 0.5L);
  return evaluatePolynomial(coefficients, S(S(1) - S(2) * w));
}

/// cotangentExcess of the angle 2 acos(w), w in [0, 1]: (1 - w f/2)/(f² (1-w²)), of which arccosineSeries has numerator
/// over 1-w². For logarithms, which need not wait for the angle.
template <class S>
inline S arccosineExcess(const S& w) {
  static constexpr auto coefficients = interpolatingPolynomial<arccosine_terms<S>>(
      [](long double sigma) {
        const long double half_ratio = arccosineSeries(sigma, 0);
        return arccosineSeries(sigma, 1) / (4 * half_ratio * half_ratio);
      },
      0.5L);
  return evaluatePolynomial(coefficients, S(S(1) - S(2) * w));
}

/// 1/√n of the squared norm n of a quaternion that is nearly always close to one, where a series is faster than a root
/// and a division.
template <class S>
inline S inverseNorm(const S& n) {
  using std::abs;
  const S e = S(1) - n;
  return branch(
      abs(e) < S(1e-5), [&] { return S(S(1) + e * (S(0.5) + e * (S(0.375) + e * S(0.3125)))); },
      [&] {
        using std::sqrt;
        return S(S(1) / sqrt(n));
      });
}

}  // namespace liestat::detail
