// The coefficients of the rotation groups of lie/detail/trig.hpp for packs of squared angles, from the same
// polynomials. Angles beyond their range are reduced by multiples of 2π, so that no result depends on a mathematical
// library, nor on what stands in the other lanes.
#pragma once

#include <lie/detail/pack.hpp>
#include <lie/detail/trig.hpp>

#include <numbers>

namespace liestat::detail {

/// Packs of float need as many terms of a series as float.
template <InstructionSet Set>
inline constexpr bool is_single_precision<Pack<Set, float>> = true;

/// The first `bits` binary digits of x in [1, 8) or so.
constexpr long double leadingDigits(long double x, int bits) {
  long double scale = 1;
  while (x * scale < 1) scale *= 2;
  for (int i = 1; i < bits; ++i) scale *= 2;
  return static_cast<long double>(static_cast<long long>(x * scale)) / scale;
}
/// 2π = a + b + c, a and b so short that their products with numbers of turns are exact up to 2²³ (float: 2¹³) turns.
template <class S>
struct FullTurn {
  static constexpr long double turn = 2 * std::numbers::pi_v<long double>;
  static constexpr int bits = sizeof(S) == 8 ? 30 : 11;
  static constexpr S a = static_cast<S>(leadingDigits(turn, bits));
  static constexpr S b = static_cast<S>(leadingDigits(turn - a, bits));
  static constexpr S c = static_cast<S>(turn - a - b);
  /// Numbers of turns beyond it are of angles whose rounding is larger than π.
  static constexpr S most = sizeof(S) == 8 ? S(1LL << 50) : S(1LL << 22);
};

/// Functions of angles from their squares t. Reduced: there may be angles beyond the range of the polynomials. Accurate
/// to some eps times one plus the angle; not-a-number for squares that are not finite.
template <bool Reduced, class P>
class PackAngle {
  using S = typename P::Scalar;

 public:
  /// The lanes for which Reduced has to be true.
  LIESTAT_ALWAYS_INLINE static typename P::Mask isLarge(const P& t) { return t > S(polynomial_range); }

  LIESTAT_ALWAYS_INLINE explicit PackAngle(const P& t) : t_(t) {
    quarter_ = S(0.25) * t;
    if constexpr (Reduced) {
      const auto large = isLarge(t);
      // θ, by a step of Newton's method to its rounding; no root is taken of what is not large.
      const P square = select(large, t, P(S(polynomial_range)));
      const P inverse = inverseSquareRoot(square);
      P theta = square * inverse;
      theta += S(0.5) * inverse * (square - theta * theta);
      // The comparisons are such that not-a-number stays.
      const P turns = truncated(smaller(theta * static_cast<S>(1 / FullTurn<S>::turn) + S(0.5), P(FullTurn<S>::most)));
      P rest = theta - turns * FullTurn<S>::a;
      rest -= turns * FullTurn<S>::b;
      rest -= turns * FullTurn<S>::c;
      // Angles that have no digits below π left give a rotation, too.
      const P pi(std::numbers::pi_v<S>);
      rest = larger(-pi, smaller(pi, rest));
      const P nothing = t - t;  // not-a-number where t is infinite
      const P sign = S(1) - S(2) * (turns - S(2) * truncated(S(0.5) * turns)) + nothing;
      const P x = select(large, S(0.25) * rest * rest, quarter_);
      sinc = series<P, 8>(sine_series, x) * select(large, sign * rest * inverse, P(S(1)));
      cos = series<P, 8>(cosine_series, x) * select(large, sign, P(S(1)));
    } else {
      sinc = series<P, 8>(sine_series, quarter_);
      cos = series<P, 8>(cosine_series, quarter_);
    }
  }

  /// sin(h)/h and cos(h) of the half angle h.
  P sinc, cos;

  LIESTAT_ALWAYS_INLINE P halfExcess() const {
    const P near = series<P, 7>(half_excess_series, quarter_);
    if constexpr (!Reduced) return near;
    return select(isLarge(t_), (sinc - cos) / quarter_, near);
  }
  LIESTAT_ALWAYS_INLINE P halfExcessSlope() const {
    const P near = series<P, 7>(half_excess_slope_series, quarter_);
    if constexpr (!Reduced) return near;
    return select(isLarge(t_), (sinc - S(3) * halfExcess()) / (S(0.5) * t_), near);
  }
  LIESTAT_ALWAYS_INLINE P beta3() const {
    const P near = series<P, 9>(beta3_series, t_);
    if constexpr (!Reduced) return near;
    return select(isLarge(t_), (S(1) - sinc * cos) / t_, near);
  }
  LIESTAT_ALWAYS_INLINE P beta4() const {
    const P near = series<P, 9>(beta4_series, t_);
    if constexpr (!Reduced) return near;
    return select(isLarge(t_), (S(1) - sinc * sinc) / (S(2) * t_), near);
  }
  LIESTAT_ALWAYS_INLINE P beta5() const {
    const P near = series<P, 9>(beta5_series, t_);
    if constexpr (!Reduced) return near;
    const P cos_theta = S(2) * cos * cos - S(1);
    return select(isLarge(t_), (S(2) - S(3) * sinc * cos + cos_theta) / (S(2) * t_ * t_), near);
  }
  LIESTAT_ALWAYS_INLINE P cotangentExcess() const { return halfExcess() / (S(4) * sinc); }

 private:
  P t_, quarter_;
};

}  // namespace liestat::detail
