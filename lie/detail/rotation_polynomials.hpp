// The polynomials of logarithms of rotations in kernels: with w = |cos| of half the angle and u the vector part of a
// unit quaternion, the rotation vector is ±f(w) u with f(w) = 2 acos(w)/√(1-w²), and the Hessian of ½ d² is
// I + g(w) (u uᵀ - |u|² I) with g(w) = (1 - w f/2)/(1-w²), which is -f'(w)/2. Both are analytic on [0, 1].
#pragma once

#include <lie/detail/arccosine.hpp>

#include <array>
#include <cstddef>

namespace liestat::detail {

/// f and g on w >= 1 - 2 range: log and exact_hessian reach the rounding of their scalar; newton_hessian, good to eight
/// digits, is for steps whose Hessian is not returned.
template <std::size_t Log, std::size_t Exact, std::size_t Newton>
struct RotationPolynomials {
  double range;
  std::array<double, Log> log = arccosinePolynomial<Log>(0, 2, range);
  std::array<double, Exact> exact_hessian = arccosinePolynomial<Exact>(1, 1, range);
  /// -g', as exact as the latter.
  std::array<double, Exact + 1> hessian_slope = arccosinePolynomial<Exact + 1>(2, 1, range);
  std::array<double, Newton> newton_hessian = arccosinePolynomial<Newton>(1, 1, range);
};
/// For all rotations.
template <class S>
inline constexpr RotationPolynomials<21, 22, 11> any_rotation{0.5};
template <>
inline constexpr RotationPolynomials<11, 12, 8> any_rotation<float>{0.5};
/// For angles up to a right angle, cos(π/4) = 0.7071…
template <class S>
inline constexpr RotationPolynomials<13, 13, 7> small_rotation{0.1465};
template <>
inline constexpr RotationPolynomials<7, 8, 6> small_rotation<float>{0.1465};
inline constexpr double small_rotation_cosine = 0.7072;

}  // namespace liestat::detail
