// Trigonometric coefficients of the rotation groups as functions of the squared angle, for every scalar type.
//
// All of them are even entire functions of the angle (or quotients of two such), so each is one polynomial in
// t = theta^2 that holds from 0 to a little beyond pi; a closed form through the half angle serves larger angles.
// The polynomials are Taylor series whose coefficients are computed here from factorials; the number of terms follows
// from the scalar's precision.
#pragma once

#include <lie/detail/always_inline.hpp>
#include <lie/detail/finite_math.hpp>
#include <lie/detail/lanes.hpp>

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

/// c[first] + c[first + stride] y + c[first + 2 stride] y² + … up to the last index below `terms`.
template <std::size_t first, std::size_t stride, std::size_t terms, class S, std::size_t N>
LIESTAT_ALWAYS_INLINE S everyNth(const std::array<double, N>& c, const S& y) {
  constexpr std::size_t last = first + (terms - 1 - first) / stride * stride;
  S sum = constant<S>(c[last]);
  LIESTAT_UNROLL for (std::size_t k = last; k > first; k -= stride) sum = sum * y + constant<S>(c[k - stride]);
  return sum;
}

/// Σ c_k x^k over the first `terms` coefficients, in chains of operations that don't wait for one another: Horner's
/// single chain takes four times as long as its multiplications. Four chains for one number; for a register
/// of them, several of which are under way at a time, two where they are short.
template <std::size_t terms, class S, std::size_t N>
LIESTAT_ALWAYS_INLINE S evaluatePolynomial(const std::array<double, N>& c, const S& x) {
  static_assert(terms >= 4 && terms <= N);
  const S x2 = x * x;
  if constexpr (terms < 16 && requires { typename S::Mask; }) {
    return everyNth<0, 2, terms>(c, x2) + everyNth<1, 2, terms>(c, x2) * x;
  } else {
#if defined(__GNUC__)
    if constexpr (has_lanes<S>) return polynomialInLanes<terms>(c, x);
#endif
    const S x4 = x2 * x2;
    const S low = everyNth<0, 4, terms>(c, x4) + everyNth<1, 4, terms>(c, x4) * x;
    const S high = everyNth<2, 4, terms>(c, x4) + everyNth<3, 4, terms>(c, x4) * x;
    return low + high * x2;
  }
}
template <class S, std::size_t N>
LIESTAT_ALWAYS_INLINE S evaluatePolynomial(const std::array<double, N>& c, const S& x) {
  return evaluatePolynomial<N>(c, x);
}

/// A power series in x, with as many terms as the scalar's precision resolves.
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

/// Closed forms beyond the range of the polynomials. Apart and rarely called: a call of libm in the middle of a formula
/// would make the compiler keep everything around it in memory.
#if defined(__GNUC__)
#define LIESTAT_BEYOND_RANGE [[gnu::cold, gnu::noinline]]
#else
#define LIESTAT_BEYOND_RANGE
#endif

template <class S>
LIESTAT_BEYOND_RANGE HalfAngle<S> wideHalfAngle(S t) {
  using std::cos, std::sin, std::sqrt;
  const S h = S(0.5) * sqrt(t);
  return HalfAngle<S>{sin(h) / h, cos(h)};
}
template <class S>
LIESTAT_BEYOND_RANGE S wideHalfExcess(S t) {
  const HalfAngle<S> a = wideHalfAngle(t);
  return S((a.sinc - a.cos) / (t * S(0.25)));
}
template <class S>
LIESTAT_BEYOND_RANGE S wideHalfExcessSlope(S t) {
  return S((wideHalfAngle(t).sinc - S(3) * wideHalfExcess(t)) / (t * S(0.5)));
}
template <class S>
LIESTAT_BEYOND_RANGE S wideBeta3(S t) {
  const HalfAngle<S> a = wideHalfAngle(t);
  return S((S(1) - a.sinc * a.cos) / t);
}
template <class S>
LIESTAT_BEYOND_RANGE S wideBeta4(S t) {
  const HalfAngle<S> a = wideHalfAngle(t);
  return S((S(1) - a.sinc * a.sinc) / (S(2) * t));
}
template <class S>
LIESTAT_BEYOND_RANGE S wideBeta5(S t) {
  const HalfAngle<S> a = wideHalfAngle(t);
  const S cos_theta = S(2) * a.cos * a.cos - S(1);
  return S((S(2) - S(3) * a.sinc * a.cos + cos_theta) / (S(2) * t * t));
}
#undef LIESTAT_BEYOND_RANGE

/// Half-angle functions from the squared angle t = theta^2 >= 0; relative error of some eps up to pi, libm's above.
template <class S>
inline HalfAngle<S> halfAngle(const S& t) {
  return branch(
      t < S(polynomial_range),
      [&] {
        const S x = t * S(0.25);
        return HalfAngle<S>{series<S, 8>(sine_series, x), series<S, 8>(cosine_series, x)};
      },
      [&] { return wideHalfAngle<S>(t); });
}

/// sin(h)/h and the excess (sin h - h cos h)/h^3 with h = theta/2, from t = theta^2: 1 and 1/3 at zero.
template <class S>
struct HalfExcess {
  S sinc, excess;
};
template <class S>
inline HalfExcess<S> halfExcess(const S& t) {
  return branch(
      t < S(polynomial_range),
      [&] {
        const S x = t * S(0.25);
        return HalfExcess<S>{series<S, 8>(sine_series, x), series<S, 7>(half_excess_series, x)};
      },
      [&] {
        return HalfExcess<S>{wideHalfAngle<S>(t).sinc, wideHalfExcess<S>(t)};
      });
}

/// The same with the excess' derivative with respect to h^2: -1/30 at zero.
template <class S>
struct HalfExcessSlope {
  S sinc, excess, slope;
};
template <class S>
inline HalfExcessSlope<S> halfExcessSlope(const S& t) {
  return branch(
      t < S(polynomial_range),
      [&] {
        const S x = t * S(0.25);
        return HalfExcessSlope<S>{series<S, 8>(sine_series, x), series<S, 7>(half_excess_series, x),
                                  series<S, 7>(half_excess_slope_series, x)};
      },
      [&] {
        return HalfExcessSlope<S>{wideHalfAngle<S>(t).sinc, wideHalfExcess<S>(t), wideHalfExcessSlope<S>(t)};
      });
}

/// (theta - sin theta)/theta^3, from t = theta^2: 1/6 at zero.
template <class S>
inline S beta3(const S& t) {
  return branch(
      t < S(polynomial_range), [&] { return series<S, 9>(beta3_series, t); }, [&] { return wideBeta3<S>(t); });
}

/// (theta^2 + 2 cos theta - 2)/(2 theta^4), from t = theta^2: 1/24 at zero.
template <class S>
inline S beta4(const S& t) {
  return branch(
      t < S(polynomial_range), [&] { return series<S, 9>(beta4_series, t); }, [&] { return wideBeta4<S>(t); });
}

/// (2 theta - 3 sin theta + theta cos theta)/(2 theta^5), from t = theta^2: 1/120 at zero.
template <class S>
inline S beta5(const S& t) {
  return branch(
      t < S(polynomial_range), [&] { return series<S, 9>(beta5_series, t); }, [&] { return wideBeta5<S>(t); });
}

/// The coefficients of SE(3)'s left Jacobian and its derivative, from t = theta^2, behind one branch: sin(h)/h of the
/// half angle and beta3 … beta5.
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
        return JacobianCoefficients<S>{wideHalfAngle<S>(t).sinc, wideBeta3<S>(t), wideBeta4<S>(t), wideBeta5<S>(t)};
      });
}

/// (1 - (theta/2) cot(theta/2))/theta^2, from t = theta^2: 1/12 at zero, 1/pi^2 at pi, a pole at 2 pi.
template <class S>
inline S cotangentExcess(const S& t) {
  const HalfExcess<S> h = halfExcess(t);
  return h.excess / (S(4) * h.sinc);
}

/// cotangentExcess and twice its derivative with respect to t, which is its derivative in theta over theta: 1/360 at 0.
template <class S>
struct InverseJacobianCoefficients {
  S excess, slope;
};
template <class S>
inline InverseJacobianCoefficients<S> inverseJacobianCoefficients(const S& t) {
  const HalfExcessSlope<S> h = halfExcessSlope(t);
  const S inverse = S(0.25) / h.sinc, c = h.excess * inverse;
  return {c, S(S(0.5) * h.slope * inverse + c * c)};
}
template <class S>
inline S cotangentExcessSlope(const S& t) {
  return inverseJacobianCoefficients(t).slope;
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

/// v·v.
template <class S>
EIGEN_ALWAYS_INLINE S squaredNorm(const Eigen::Matrix<S, 3, 1>& v) {
  return v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
}

/// a·b.
template <class S>
EIGEN_ALWAYS_INLINE S dot(const Eigen::Matrix<S, 3, 1>& a, const Eigen::Matrix<S, 3, 1>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/// s a + t b, coordinate by coordinate.
template <class S>
EIGEN_ALWAYS_INLINE Eigen::Matrix<S, 3, 1> combination(const S& s, const Eigen::Matrix<S, 3, 1>& a, const S& t,
                                                       const Eigen::Matrix<S, 3, 1>& b) {
  return Eigen::Matrix<S, 3, 1>(s * a[0] + t * b[0], s * a[1] + t * b[1], s * a[2] + t * b[2]);
}

/// a + b v×a + c v×(v×a), coordinate by coordinate.
template <class S>
EIGEN_ALWAYS_INLINE Eigen::Matrix<S, 3, 1> crossPolynomialTimes(const Eigen::Matrix<S, 3, 1>& v, const S& b, const S& c,
                                                                const Eigen::Matrix<S, 3, 1>& a) {
  const S x = v[0], y = v[1], z = v[2], p = a[0], q = a[1], r = a[2];
  const S i = y * r - z * q, j = z * p - x * r, k = x * q - y * p;
  return Eigen::Matrix<S, 3, 1>(p + b * i + c * (y * k - z * j), q + b * j + c * (z * i - x * k),
                                r + b * k + c * (x * j - y * i));
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
EIGEN_ALWAYS_INLINE Eigen::Matrix<S, 3, 3> symmetricPlusSkew(const Eigen::Matrix<S, 3, 1>& a,
                                                             const Eigen::Matrix<S, 3, 1>& b, const S& s,
                                                             const Eigen::Matrix<S, 3, 1>& v) {
  const S xy = a[0] * b[1] + a[1] * b[0], xz = a[0] * b[2] + a[2] * b[0], yz = a[1] * b[2] + a[2] * b[1];
  Eigen::Matrix<S, 3, 3> m;
  m(0, 0) = S(2) * a[0] * b[0] + s, m(1, 0) = xy + v[2], m(2, 0) = xz - v[1];
  m(0, 1) = xy - v[2], m(1, 1) = S(2) * a[1] * b[1] + s, m(2, 1) = yz + v[0];
  m(0, 2) = xz + v[1], m(1, 2) = yz - v[0], m(2, 2) = S(2) * a[2] * b[2] + s;
  return m;
}

/// a I + b [v] + c [v]^2, the form of every SO(3) Jacobian, without forming products of matrices.
template <class S>
EIGEN_ALWAYS_INLINE Eigen::Matrix<S, 3, 3> rotationPolynomial(const Eigen::Matrix<S, 3, 1>& v, const S& a, const S& b,
                                                              const S& c) {
  const S x = v[0], y = v[1], z = v[2], cx = c * x, cy = c * y, cz = c * z;
  const S xx = cx * x, yy = cy * y, zz = cz * z, xy = cx * y, xz = cx * z, yz = cy * z;
  const S p = b * x, q = b * y, r = b * z;
  Eigen::Matrix<S, 3, 3> m;
  m(0, 0) = a - yy - zz, m(1, 0) = xy + r, m(2, 0) = xz - q;
  m(0, 1) = xy - r, m(1, 1) = a - xx - zz, m(2, 1) = yz + p;
  m(0, 2) = xz + q, m(1, 2) = yz - p, m(2, 2) = a - xx - yy;
  return m;
}

}  // namespace liestat::detail
