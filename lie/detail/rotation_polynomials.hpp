// The polynomials of logarithms of rotations in kernels: with w = |cos| of half the angle and u the vector part of a
// unit quaternion, the rotation vector is ±f(w) u with f(w) = 2 acos(w)/√(1-w²), and the Hessian of ½ d² is
// I + g(w) (u uᵀ - |u|² I) with g(w) = (1 - w f/2)/(1-w²), which is -f'(w)/2. Both are analytic on [0, 1].
#pragma once

#include <lie/detail/arccosine.hpp>

#include <array>
#include <cstddef>

namespace liestat::detail {

/// f and g on w >= 1 - 2 range, the range in units of 1e-4: log and exact_hessian reach the rounding of their scalar;
/// newton_hessian, good to eight digits, is for steps whose Hessian is not returned. A unit computes those that it uses.
template <std::size_t Log, std::size_t Exact, std::size_t Newton, int range_in_units>
struct RotationPolynomials {
  static constexpr double range = 1e-4 * range_in_units;
  static constexpr std::array<double, Log> log = arccosinePolynomial<Log>(0, 2, range);
  static constexpr std::array<double, Exact> exact_hessian = arccosinePolynomial<Exact>(1, 1, range);
  /// -g', as exact as the latter.
  static constexpr std::array<double, Exact + 1> hessian_slope = arccosinePolynomial<Exact + 1>(2, 1, range);
  static constexpr std::array<double, Newton> newton_hessian = arccosinePolynomial<Newton>(1, 1, range);
};
/// For all rotations.
template <class S>
inline constexpr RotationPolynomials<21, 22, 11, 5000> any_rotation{};
template <>
inline constexpr RotationPolynomials<11, 12, 8, 5000> any_rotation<float>{};
/// For angles up to a right angle, cos(π/4) = 0.7071…
template <class S>
inline constexpr RotationPolynomials<13, 13, 7, 1465> small_rotation{};
template <>
inline constexpr RotationPolynomials<7, 8, 6, 1465> small_rotation<float>{};
inline constexpr double small_rotation_cosine = 0.7072;

}  // namespace liestat::detail
