// Trigonometric coefficients of the rotation groups as functions of the squared angle, for every scalar type.
//
// All of them are even entire functions of the angle (or quotients of two such), so each is one polynomial in
// t = theta^2 that holds from 0 to a little beyond pi; a closed form through the half angle serves larger angles.
// The polynomials are Taylor series whose coefficients are computed here from factorials; the number of terms follows
// from the scalar's precision.
#pragma once

#include <lie/detail/always_inline.hpp>
#include <lie/detail/finite_math.hpp>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <cstddef>
#include <type_traits>

namespace liestat::detail {

/// True for scalars of single precision: they need fewer terms, and products renormalise to first order.
template <class S>
inline constexpr bool is_single_precision = std::is_same_v<S, float>;

/// a where the mask holds, else b. Batches of values bring their own overload, found by argument-dependent look-up.
template <class S>
constexpr S select(bool mask, const S& a, const S& b) {
  return mask ? a : b;
}

/// f() where the mask holds, else g(); only one of them runs when the mask is a plain bool. Both must be safe to run
/// for masks of batches, which evaluate both.
template <class F, class G>
constexpr auto branch(bool mask, F&& f, G&& g) {
  return mask ? f() : g();
}

/// (-1)^k / (2k + offset)!, k = 0 … N-1, times a polynomial factor in k.
template <int N, class Factor>
constexpr std::array<double, static_cast<std::size_t>(N)> factorialSeries(int offset, Factor factor) {
  std::array<double, static_cast<std::size_t>(N)> coefficients{};
  for (int k = 0; k < N; ++k) {
    long double factorial = 1;
    for (int i = 2; i <= 2 * k + offset; ++i) factorial *= i;
    const long double c = static_cast<long double>(factor(k)) / factorial;
    coefficients[static_cast<std::size_t>(k)] = static_cast<double>(k % 2 == 0 ? c : -c);
  }
  return coefficients;
}

/// A number of the type S: scalars, and batches of them in every lane.
template <class S>
LIESTAT_ALWAYS_INLINE S constant(double c) {
  if constexpr (requires { typename S::Mask; }) {
    return S(static_cast<typename S::Scalar>(c));
  } else {
    return S(c);
  }
}

/// c[first] + c[first + 4] x4 + c[first + 8] x4² + … up to the last index below `terms`.
template <std::size_t first, std::size_t terms, class S, std::size_t N>
LIESTAT_ALWAYS_INLINE S everyFourth(const std::array<double, N>& c, const S& x4) {
  constexpr std::size_t last = first + (terms - 1 - first) / 4 * 4;
  S sum = constant<S>(c[last]);
  LIESTAT_UNROLL for (std::size_t k = last; k > first; k -= 4) sum = sum * x4 + constant<S>(c[k - 4]);
  return sum;
}

/// Σ c_k x^k over the first `terms` coefficients, in four chains of operations that don't wait for one another:
/// Horner's single chain takes four times as long as its multiplications.
template <std::size_t terms, class S, std::size_t N>
LIESTAT_ALWAYS_INLINE S evaluatePolynomial(const std::array<double, N>& c, const S& x) {
  static_assert(terms >= 4 && terms <= N);
  const S x2 = x * x, x4 = x2 * x2;
  const S low = everyFourth<0, terms>(c, x4) + everyFourth<1, terms>(c, x4) * x;
  const S high = everyFourth<2, terms>(c, x4) + everyFourth<3, terms>(c, x4) * x;
  return low + high * x2;
}
template <class S, std::size_t N>
LIESTAT_ALWAYS_INLINE S evaluatePolynomial(const std::array<double, N>& c, const S& x) {
  return evaluatePolynomial<N>(c, x);
}

/// Of a power series as many terms as the scalar's precision can see.
template <class S, std::size_t SingleTerms, std::size_t N>
LIESTAT_ALWAYS_INLINE S series(const std::array<double, N>& c, const S& x) {
  return evaluatePolynomial < is_single_precision<S> ? SingleTerms : N > (c, x);
}

/// Largest squared angle of the polynomial range: a little above pi^2.
inline constexpr double polynomial_range = 10.5;

inline constexpr auto sine_series = factorialSeries<12>(1, [](int) { return 1; });
inline constexpr auto cosine_series = factorialSeries<12>(0, [](int) { return 1; });
inline constexpr auto half_excess_series = factorialSeries<12>(3, [](int k) { return 2 * k + 2; });
inline constexpr auto half_excess_slope_series = factorialSeries<12>(5, [](int k) { return -(k + 2) * (2 * k + 2); });
inline constexpr auto beta3_series = factorialSeries<14>(3, [](int) { return 1; });
inline constexpr auto beta4_series = factorialSeries<14>(4, [](int) { return 1; });
inline constexpr auto beta5_series = factorialSeries<14>(5, [](int k) { return k + 1; });

/// sin(h)/h and cos(h) of the half angle h = theta/2.
template <class S>
struct HalfAngle {
  S sinc, cos;
};

/// Half-angle functions from the squared angle t = theta^2 >= 0; relative error of some eps up to pi, libm's above.
template <class S>
inline HalfAngle<S> halfAngle(const S& t) {
  return branch(
      t < S(polynomial_range),
      [&] {
        const S x = t * S(0.25);
        return HalfAngle<S>{series<S, 8>(sine_series, x), series<S, 8>(cosine_series, x)};
      },
      [&] {
        using std::cos, std::sin, std::sqrt;
        const S h = S(0.5) * sqrt(t);
        return HalfAngle<S>{sin(h) / h, cos(h)};
      });
}

/// (sin h - h cos h)/h^3 with h = theta/2, from t = theta^2: 1/3 at zero.
template <class S>
inline S halfExcess(const S& t) {
  return branch(
      t < S(polynomial_range), [&] { return series<S, 7>(half_excess_series, S(t * S(0.25))); },
      [&] {
        const HalfAngle<S> a = halfAngle(t);
        return S((a.sinc - a.cos) / (t * S(0.25)));
      });
}

/// Derivative of halfExcess with respect to h^2, from t = theta^2 = 4 h^2: -1/30 at zero.
template <class S>
inline S halfExcessSlope(const S& t) {
  return branch(
      t < S(polynomial_range), [&] { return series<S, 7>(half_excess_slope_series, S(t * S(0.25))); },
      [&] {
        const HalfAngle<S> a = halfAngle(t);
        return S((a.sinc - S(3) * halfExcess(t)) / (t * S(0.5)));
      });
}

/// (theta - sin theta)/theta^3, from t = theta^2: 1/6 at zero.
template <class S>
inline S beta3(const S& t) {
  return branch(
      t < S(polynomial_range), [&] { return series<S, 9>(beta3_series, t); },
      [&] {
        const HalfAngle<S> a = halfAngle(t);
        return S((S(1) - a.sinc * a.cos) / t);
      });
}

/// (theta^2 + 2 cos theta - 2)/(2 theta^4), from t = theta^2: 1/24 at zero.
template <class S>
inline S beta4(const S& t) {
  return branch(
      t < S(polynomial_range), [&] { return series<S, 9>(beta4_series, t); },
      [&] {
        const HalfAngle<S> a = halfAngle(t);
        return S((S(1) - a.sinc * a.sinc) / (S(2) * t));
      });
}

/// (2 theta - 3 sin theta + theta cos theta)/(2 theta^5), from t = theta^2: 1/120 at zero.
template <class S>
inline S beta5(const S& t) {
  return branch(
      t < S(polynomial_range), [&] { return series<S, 9>(beta5_series, t); },
      [&] {
        const HalfAngle<S> a = halfAngle(t);
        const S cos_theta = S(2) * a.cos * a.cos - S(1);
        return S((S(2) - S(3) * a.sinc * a.cos + cos_theta) / (S(2) * t * t));
      });
}

/// The coefficients of the left Jacobian and of its derivative, from t = theta^2, behind one branch.
template <class S>
struct JacobianCoefficients {
  S half_sinc, beta3, beta4, beta5;
};
template <class S>
inline JacobianCoefficients<S> jacobianCoefficients(const S& t) {
  return branch(
      t < S(polynomial_range),
      [&] {
        return JacobianCoefficients<S>{series<S, 8>(sine_series, S(t * S(0.25))), series<S, 9>(beta3_series, t),
                                       series<S, 9>(beta4_series, t), series<S, 9>(beta5_series, t)};
      },
      [&] {
        return JacobianCoefficients<S>{halfAngle(t).sinc, beta3(t), beta4(t), beta5(t)};
      });
}

/// (1 - (theta/2) cot(theta/2))/theta^2, from t = theta^2: 1/12 at zero, 1/pi^2 at pi, a pole at 2 pi.
template <class S>
inline S cotangentExcess(const S& t) {
  return halfExcess(t) / (S(4) * halfAngle(t).sinc);
}

/// Twice the derivative of cotangentExcess with respect to t, which is its derivative in theta over theta: 1/360 at 0.
template <class S>
inline S cotangentExcessSlope(const S& t) {
  const S s = halfAngle(t).sinc, e = halfExcess(t);
  return (halfExcessSlope(t) * s + S(0.5) * e * e) / (S(8) * s * s);
}

inline constexpr std::array<double, 9> arctangent_series{1.0,       -1.0 / 3, 1.0 / 5,   -1.0 / 7, 1.0 / 9,
                                                         -1.0 / 11, 1.0 / 13, -1.0 / 15, 1.0 / 17};

/// atan2(y, x)/y from y^2: regular at y = 0 for x > 0. Scale: the result goes with 1/|(x, y)|.
template <class S>
inline S arctangentOverSine(const S& y2, const S& x) {
  using std::abs;
  // x·|x|, for the series is that of x > 0 alone.
  return branch(
      y2 < S(0.0125) * x * abs(x), [&] { return S(series<S, 5>(arctangent_series, S(y2 / (x * x))) / x); },
      [&] {
        using std::atan2, std::sqrt;
        const S y = sqrt(y2);
        return S(atan2(y, x) / y);
      });
}

/// |v|; zero, with derivative zero, at zero.
template <class Derived>
inline typename Derived::Scalar norm(const Eigen::MatrixBase<Derived>& v) {
  using S = typename Derived::Scalar;
  const S squared = v.dot(v);
  return branch(
      squared > S(0),
      [&] {
        using std::sqrt;
        return S(sqrt(squared));
      },
      [] { return S(0); });
}

/// Three coefficients from `first` on, one by one: a copy in packets would wait for stores of another alignment.
template <int first, class Derived>
inline Eigen::Matrix<typename Derived::Scalar, 3, 1> three(const Eigen::MatrixBase<Derived>& v) {
  return Eigen::Matrix<typename Derived::Scalar, 3, 1>(v[first], v[first + 1], v[first + 2]);
}

/// The cross-product matrix [v]: [v] w = v × w.
template <class Derived>
inline Eigen::Matrix<typename Derived::Scalar, 3, 3> skew(const Eigen::MatrixBase<Derived>& v) {
  using S = typename Derived::Scalar;
  Eigen::Matrix<S, 3, 3> m;
  m << S(0), -v[2], v[1], v[2], S(0), -v[0], -v[1], v[0], S(0);
  return m;
}

/// [v] M for a 3×3 matrix.
template <class S>
inline Eigen::Matrix<S, 3, 3> skewTimes(const Eigen::Matrix<S, 3, 1>& v, const Eigen::Matrix<S, 3, 3>& M) {
  Eigen::Matrix<S, 3, 3> m;
  for (int j = 0; j < 3; ++j) {
    m(0, j) = v[1] * M(2, j) - v[2] * M(1, j);
    m(1, j) = v[2] * M(0, j) - v[0] * M(2, j);
    m(2, j) = v[0] * M(1, j) - v[1] * M(0, j);
  }
  return m;
}

/// a bᵀ + b aᵀ + s I + [v]
template <class S>
inline Eigen::Matrix<S, 3, 3> symmetricPlusSkew(const Eigen::Matrix<S, 3, 1>& a, const Eigen::Matrix<S, 3, 1>& b,
                                                const S& s, const Eigen::Matrix<S, 3, 1>& v) {
  const S xy = a[0] * b[1] + a[1] * b[0], xz = a[0] * b[2] + a[2] * b[0], yz = a[1] * b[2] + a[2] * b[1];
  Eigen::Matrix<S, 3, 3> m;
  m << S(2) * a[0] * b[0] + s, xy - v[2], xz + v[1],  //
      xy + v[2], S(2) * a[1] * b[1] + s, yz - v[0],   //
      xz - v[1], yz + v[0], S(2) * a[2] * b[2] + s;
  return m;
}

/// a I + b [v] + c [v]^2, the form of every SO(3) Jacobian, without forming products of matrices.
template <class S>
inline Eigen::Matrix<S, 3, 3> rotationPolynomial(const Eigen::Matrix<S, 3, 1>& v, const S& a, const S& b, const S& c) {
  const S xx = c * v[0] * v[0], yy = c * v[1] * v[1], zz = c * v[2] * v[2];
  const S xy = c * v[0] * v[1], xz = c * v[0] * v[2], yz = c * v[1] * v[2];
  const Eigen::Matrix<S, 3, 1> w = b * v;
  Eigen::Matrix<S, 3, 3> m;
  m << a - yy - zz, xy - w[2], xz + w[1],  //
      xy + w[2], a - xx - zz, yz - w[0],   //
      xz - w[1], yz + w[0], a - xx - yy;
  return m;
}

}  // namespace liestat::detail
