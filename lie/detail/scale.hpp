// The range of the scale in RxSO2, RxSO3, Sim2 and Sim3: as in Sophus, products and exponentials that would leave it
// stop at its ends, so that no scale becomes zero or infinite.
#pragma once

#include <lie/detail/trig.hpp>
#include <lie/detail/uniform.hpp>

namespace liestat::detail {

/// The least scale and its logarithm; the largest is the inverse. A bare type, so that floats of a wrapped kind (Jet,
/// batches of double) have that of double.
template <class S>
struct ScaleRange {
  static constexpr double least = is_single_precision<S> ? 1e-5 : 1e-10;
  /// Logarithm of a scale that stays in the range after rounding: a little above the least.
  static constexpr double min_logarithm = is_single_precision<S> ? -11.512915 : -23.0258509298;
};

/// The logarithm of a scale, at least and at most what the range admits.
template <class S>
inline S saturatedLogarithm(const S& sigma) {
  const S low = static_cast<S>(ScaleRange<S>::min_logarithm), high = -low;
  const S above = select(sigma < low, low, sigma);
  return select(above > high, high, above);
}

/// Parameters whose squared norm is `squared`, scaled into [least, 1/least] of that squared norm.
template <class Params, class S>
inline Params saturated(const Params& p, const S& squared, double least) {
  // Only a product out of range pays for the square root.
  return branch(
      !(squared < S(least)) && !(squared > S(1 / least)), [&] { return p; },
      [&]() -> Params {
        using std::sqrt;
        const S bound = select(squared < S(1), S(least * (1 + 1e-6)), S(1 / (least * (1 + 1e-6))));
        return p * sqrt(S(bound / squared));
      });
}

/// A scale whose logarithm to base 2 is uniform in [-1, 1].
template <class S, class Generator>
S uniformScale(Generator& generator) {
  return S(std::exp2(2 * uniform01(generator) - 1));
}

}  // namespace liestat::detail
