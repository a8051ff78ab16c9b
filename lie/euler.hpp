// Euler angles of a rotation, all twelve conventions by name.
//
// EulerAxes::zyx with angles (a, b, c) is the rotation Rz(a)·Ry(b)·Rx(c): about the axes of the turning body, z first
// (intrinsic), which is the same as about fixed axes, x first (extrinsic), with the angles in reverse order.
//
// No cosine is inverted, so that angles are exact to rounding everywhere, also next to gimbal lock, where other
// formulas lose half of the digits: E. Bernardes, S. Viollet, "Quaternion to Euler angles conversion: a direct, general
// and computationally efficient method", PLoS ONE 17(11), 2022. At gimbal lock only the sum or the difference of the
// first and the last angle is known; both are then given the same absolute value.
#pragma once

#include <lie/so3.hpp>

#include <array>
#include <cstddef>

namespace liestat {

/// The axes of three successive rotations, each about the body's axis as the ones before it have left it.
enum class EulerAxes { xyz, xzy, yxz, yzx, zxy, zyx, xyx, xzx, yxy, yzy, zxz, zyz };

namespace detail {

/// The axes as indices, and +1 if the first, the second and the remaining one are right-handed, else -1.
struct EulerSequence {
  int first, second, third, handedness;
};
inline EulerSequence eulerSequence(EulerAxes axes) {
  constexpr std::array<std::array<int, 3>, 12> table{{{0, 1, 2},
                                                      {0, 2, 1},
                                                      {1, 0, 2},
                                                      {1, 2, 0},
                                                      {2, 0, 1},
                                                      {2, 1, 0},
                                                      {0, 1, 0},
                                                      {0, 2, 0},
                                                      {1, 0, 1},
                                                      {1, 2, 1},
                                                      {2, 0, 2},
                                                      {2, 1, 2}}};
  const auto& [i, j, k] = table[static_cast<std::size_t>(axes)];
  return {i, j, k, (j - i + 3) % 3 == 1 ? 1 : -1};
}

/// The angle in [-pi, pi], from one in [-2 pi, 2 pi].
template <class S>
S wrappedOnce(const S& angle) {
  const S half(static_cast<double>(EIGEN_PI)), turn(S(2) * half);
  const S below = select(angle > half, S(angle - turn), angle);
  return select(below < -half, S(below + turn), below);
}

}  // namespace detail

/// The rotation of three angles (rad) about the named axes.
template <class S>
SO3<S> fromEuler(EulerAxes axes, const Eigen::Matrix<S, 3, 1>& angles) {
  using Vector = Eigen::Matrix<S, 3, 1>;
  const detail::EulerSequence e = detail::eulerSequence(axes);
  return SO3<S>::exp(angles[0] * Vector::Unit(e.first)) * SO3<S>::exp(angles[1] * Vector::Unit(e.second)) *
         SO3<S>::exp(angles[2] * Vector::Unit(e.third));
}

/// The angles (rad) of a rotation about the named axes: first and last in [-pi, pi], the second in [-pi/2, pi/2], or in
/// [0, pi] where the last axis is the first.
template <class Derived>
auto toEuler(EulerAxes axes, const SO3Base<Derived>& rotation) {
  using S = typename SO3Base<Derived>::Scalar;
  using std::atan2, std::sqrt;
  const auto& q = rotation.params();
  const detail::EulerSequence e = detail::eulerSequence(axes);
  const bool proper = e.third == e.first;
  const int remaining = 3 - e.first - e.second;
  const S sign(e.handedness);
  const S w = q[3], i = q[e.first], j = q[e.second], k = sign * q[remaining];
  // (a, b) is the half-sum of the outer angles in polar form, (c, d) their half-difference.
  const S a = proper ? w : S(w + j), b = proper ? i : S(i + k);
  const S c = proper ? j : S(w - j), d = proper ? k : S(i - k);
  const S half_sum = atan2(b, a), half_difference = atan2(d, c);
  const S first_radius = sqrt(a * a + b * b), second_radius = sqrt(c * c + d * d);
  const S middle = proper ? S(S(2) * atan2(second_radius, first_radius))
                          : S(S(2) * atan2(first_radius, second_radius) - S(static_cast<double>(EIGEN_PI) / 2));
  const S last = half_sum - half_difference;
  return Eigen::Matrix<S, 3, 1>(detail::wrappedOnce(S(half_sum + half_difference)), middle,
                                detail::wrappedOnce(proper ? last : S(sign * last)));
}

/// Rz(yaw)·Ry(pitch)·Rx(roll), rad: the convention of vehicles and aircraft.
template <class S>
SO3<S> fromRollPitchYaw(const S& roll, const S& pitch, const S& yaw) {
  return fromEuler<S>(EulerAxes::zyx, Eigen::Matrix<S, 3, 1>(yaw, pitch, roll));
}

/// (roll, pitch, yaw), rad; pitch in [-pi/2, pi/2].
template <class Derived>
auto toRollPitchYaw(const SO3Base<Derived>& rotation) {
  return toEuler(EulerAxes::zyx, rotation).reverse().eval();
}

}  // namespace liestat
