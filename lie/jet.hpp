// Jet: a number with its derivatives, for derivatives that are exact to rounding. Needs Eigen alone.
//
//   liestat::Jet<double, 2> x(3, 0), y(4, 1);   // values, and which variable each is
//   const auto r = sqrt(x * x + y * y);         // r.a = 5, r.v = (0.6, 0.8)
//
// Every function that is generic in the scalar, and every manifold of the library, takes Jets. A Jet of Jets has the
// second derivatives. ceres::Jet has the same members and may be used in its place.
//
// Storage        value a, derivatives v (N of them)
// Comparisons    those of the values
// Bad input      as of the scalar: NaN in, NaN out; derivatives that do not exist, such as that of sqrt at 0, are
//                infinite or NaN
#pragma once

#include <Eigen/Core>

#include <cmath>
#include <limits>
#include <ostream>
#include <type_traits>

namespace liestat {

template <class S, int N>
struct Jet {
  using Scalar = S;
  static constexpr int DIMENSION = N;
  using Derivatives = Eigen::Matrix<S, N, 1>;

  S a = S(0);
  Derivatives v = Derivatives::Zero();

  Jet() = default;
  /// A constant.
  Jet(const S& value) : a(value) {}  // NOLINT: numbers are Jets
  template <class A>
    requires(std::is_arithmetic_v<A> && !std::is_same_v<A, S>)
  Jet(A value) : a(static_cast<S>(value)) {}  // NOLINT: numbers are Jets
  /// The k-th variable.
  Jet(const S& value, int k) : a(value) { v[k] = S(1); }
  /// A value with its derivatives.
  template <class D>
  Jet(const S& value, const Eigen::MatrixBase<D>& derivatives) : a(value), v(derivatives) {}

  Jet& operator+=(const Jet& y) { return a += y.a, v += y.v, *this; }
  Jet& operator-=(const Jet& y) { return a -= y.a, v -= y.v, *this; }
  Jet& operator*=(const Jet& y) { return *this = *this * y; }
  Jet& operator/=(const Jet& y) { return *this = *this / y; }

  friend Jet operator+(const Jet& x) { return x; }
  friend Jet operator-(const Jet& x) { return {-x.a, -x.v}; }
  friend Jet operator+(const Jet& x, const Jet& y) { return {x.a + y.a, x.v + y.v}; }
  friend Jet operator-(const Jet& x, const Jet& y) { return {x.a - y.a, x.v - y.v}; }
  friend Jet operator*(const Jet& x, const Jet& y) { return {x.a * y.a, x.v * y.a + y.v * x.a}; }
  friend Jet operator/(const Jet& x, const Jet& y) {
    const S inverse = S(1) / y.a, quotient = x.a * inverse;
    return {quotient, (x.v - y.v * quotient) * inverse};
  }

  friend bool operator==(const Jet& x, const Jet& y) { return x.a == y.a; }
  friend bool operator!=(const Jet& x, const Jet& y) { return x.a != y.a; }
  friend bool operator<(const Jet& x, const Jet& y) { return x.a < y.a; }
  friend bool operator<=(const Jet& x, const Jet& y) { return x.a <= y.a; }
  friend bool operator>(const Jet& x, const Jet& y) { return x.a > y.a; }
  friend bool operator>=(const Jet& x, const Jet& y) { return x.a >= y.a; }

  friend std::ostream& operator<<(std::ostream& out, const Jet& x) {
    return out << '[' << x.a << " ; " << x.v.transpose() << ']';
  }

  /// f(x) of a value f and a slope f' at x.
  Jet mapped(const S& value, const S& slope) const { return {value, v * slope}; }
};

// The functions of <cmath>, found by argument-dependent look-up. Slopes are of the scalar's own type, so that Jets
// nest.

template <class S, int N>
Jet<S, N> abs(const Jet<S, N>& x) {
  return x.a < S(0) ? -x : x;
}
template <class S, int N>
Jet<S, N> sqrt(const Jet<S, N>& x) {
  using std::sqrt;
  const S root = sqrt(x.a);
  return x.mapped(root, S(1) / (S(2) * root));
}
template <class S, int N>
Jet<S, N> cbrt(const Jet<S, N>& x) {
  using std::cbrt;
  const S root = cbrt(x.a);
  return x.mapped(root, S(1) / (S(3) * root * root));
}
template <class S, int N>
Jet<S, N> exp(const Jet<S, N>& x) {
  using std::exp;
  const S value = exp(x.a);
  return x.mapped(value, value);
}
template <class S, int N>
Jet<S, N> expm1(const Jet<S, N>& x) {
  using std::exp, std::expm1;
  return x.mapped(expm1(x.a), exp(x.a));
}
template <class S, int N>
Jet<S, N> log(const Jet<S, N>& x) {
  using std::log;
  return x.mapped(log(x.a), S(1) / x.a);
}
template <class S, int N>
Jet<S, N> log1p(const Jet<S, N>& x) {
  using std::log1p;
  return x.mapped(log1p(x.a), S(1) / (S(1) + x.a));
}
template <class S, int N>
Jet<S, N> sin(const Jet<S, N>& x) {
  using std::cos, std::sin;
  return x.mapped(sin(x.a), cos(x.a));
}
template <class S, int N>
Jet<S, N> cos(const Jet<S, N>& x) {
  using std::cos, std::sin;
  return x.mapped(cos(x.a), -sin(x.a));
}
template <class S, int N>
Jet<S, N> tan(const Jet<S, N>& x) {
  using std::tan;
  const S value = tan(x.a);
  return x.mapped(value, S(1) + value * value);
}
template <class S, int N>
Jet<S, N> asin(const Jet<S, N>& x) {
  using std::asin, std::sqrt;
  return x.mapped(asin(x.a), S(1) / sqrt(S(1) - x.a * x.a));
}
template <class S, int N>
Jet<S, N> acos(const Jet<S, N>& x) {
  using std::acos, std::sqrt;
  return x.mapped(acos(x.a), S(-1) / sqrt(S(1) - x.a * x.a));
}
template <class S, int N>
Jet<S, N> atan(const Jet<S, N>& x) {
  using std::atan;
  return x.mapped(atan(x.a), S(1) / (S(1) + x.a * x.a));
}
template <class S, int N>
Jet<S, N> sinh(const Jet<S, N>& x) {
  using std::cosh, std::sinh;
  return x.mapped(sinh(x.a), cosh(x.a));
}
template <class S, int N>
Jet<S, N> cosh(const Jet<S, N>& x) {
  using std::cosh, std::sinh;
  return x.mapped(cosh(x.a), sinh(x.a));
}
template <class S, int N>
Jet<S, N> tanh(const Jet<S, N>& x) {
  using std::tanh;
  const S value = tanh(x.a);
  return x.mapped(value, S(1) - value * value);
}
template <class S, int N>
Jet<S, N> atan2(const Jet<S, N>& y, const Jet<S, N>& x) {
  using std::atan2;
  const S inverse = S(1) / (x.a * x.a + y.a * y.a);
  return {atan2(y.a, x.a), (y.v * x.a - x.v * y.a) * inverse};
}
template <class S, int N>
Jet<S, N> hypot(const Jet<S, N>& x, const Jet<S, N>& y) {
  using std::hypot;
  const S value = hypot(x.a, y.a), inverse = S(1) / value;
  return {value, (x.v * x.a + y.v * y.a) * inverse};
}
/// x to a constant power.
template <class S, int N>
Jet<S, N> pow(const Jet<S, N>& x, const std::type_identity_t<S>& power) {
  using std::pow;
  return x.mapped(pow(x.a, power), power * pow(x.a, power - S(1)));
}
/// A power that varies: for positive x.
template <class S, int N>
Jet<S, N> pow(const Jet<S, N>& x, const Jet<S, N>& power) {
  return exp(power * log(x));
}
template <class S, int N>
Jet<S, N> fmin(const Jet<S, N>& x, const Jet<S, N>& y) {
  return y.a < x.a ? y : x;
}
template <class S, int N>
Jet<S, N> fmax(const Jet<S, N>& x, const Jet<S, N>& y) {
  return x.a < y.a ? y : x;
}
template <class S, int N>
bool isfinite(const Jet<S, N>& x) {
  using std::isfinite;
  for (int k = 0; k < N; ++k) {
    if (!isfinite(x.v[k])) return false;
  }
  return isfinite(x.a);
}
template <class S, int N>
bool isnan(const Jet<S, N>& x) {
  using std::isnan;
  for (int k = 0; k < N; ++k) {
    if (isnan(x.v[k])) return true;
  }
  return isnan(x.a);
}

}  // namespace liestat

/// Limits of a Jet are those of its scalar.
template <class S, int N>
struct std::numeric_limits<liestat::Jet<S, N>> : std::numeric_limits<S> {
  using Jet = liestat::Jet<S, N>;
  static constexpr Jet min() noexcept { return Jet(std::numeric_limits<S>::min()); }
  static constexpr Jet max() noexcept { return Jet(std::numeric_limits<S>::max()); }
  static constexpr Jet lowest() noexcept { return Jet(std::numeric_limits<S>::lowest()); }
  static constexpr Jet epsilon() noexcept { return Jet(std::numeric_limits<S>::epsilon()); }
  static constexpr Jet infinity() noexcept { return Jet(std::numeric_limits<S>::infinity()); }
  static constexpr Jet quiet_NaN() noexcept { return Jet(std::numeric_limits<S>::quiet_NaN()); }
};

namespace Eigen {

template <class S, int N>
struct NumTraits<liestat::Jet<S, N>> : GenericNumTraits<liestat::Jet<S, N>> {
  using Real = liestat::Jet<S, N>;
  using NonInteger = Real;
  using Nested = Real;
  using Literal = S;
  static Real dummy_precision() { return Real(NumTraits<S>::dummy_precision()); }
  static Real epsilon() { return Real(NumTraits<S>::epsilon()); }
  static int digits10() { return NumTraits<S>::digits10(); }
  enum {
    IsComplex = 0,
    IsInteger = 0,
    IsSigned = 1,
    RequireInitialization = 1,
    ReadCost = 1,
    AddCost = 1 + N,
    MulCost = 3 + 2 * N,
    HasFloatingPoint = 1
  };
};

template <class Operation, class S, int N>
struct ScalarBinaryOpTraits<liestat::Jet<S, N>, S, Operation> {
  using ReturnType = liestat::Jet<S, N>;
};
template <class Operation, class S, int N>
struct ScalarBinaryOpTraits<S, liestat::Jet<S, N>, Operation> {
  using ReturnType = liestat::Jet<S, N>;
};

}  // namespace Eigen
