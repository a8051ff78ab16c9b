// How far two states are from a preintegrated motion between them: the residual of a factor, with its Jacobians.
//
// With Γ = (I, g t²/2, g t) and Φ_t(X) = (R, p + t v, v), states that agree with an increment D satisfy
// X_j = Γ Φ_t(X_i) D in SE_2(3). The residual is log(D⁻¹ Y), Y = Φ_t(X_i)⁻¹ Γ⁻¹ X_j, in the tangent in which the
// increment's covariance is given, so that its Mahalanobis distance is χ² with nine degrees of freedom.
#pragma once

#include <fusion/imu/preintegration.hpp>
#include <lie/detail/small_products.hpp>

#include <utility>

namespace liestat {

/// A residual with its derivatives, exact at any size: by both states (right perturbations, position, rotation,
/// velocity), by the biases (gyroscope, accelerometer) and by gravity.
template <class S>
struct PreintegrationResidual {
  Eigen::Matrix<S, 9, 1> value;
  Eigen::Matrix<S, 9, 9> by_first, by_second;
  Eigen::Matrix<S, 9, 6> by_bias;
  Eigen::Matrix<S, 9, 3> by_gravity;
};

/// Y: the motion that two states imply over t seconds under gravity (m/s², in the axes of the states' world).
template <class S>
SE23<S> impliedIncrement(const SE23<S>& first, const SE23<S>& second, const S& t,
                         const Eigen::Matrix<S, 3, 1>& gravity) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const SO3<S> back = SO3<S>(first.so3()).inverse();
  const Vector3 velocity = back * Vector3(second.velocity() - first.velocity() - t * gravity);
  const Vector3 position =
      back * Vector3(second.translation() - first.translation() - t * first.velocity() - (S(0.5) * t * t) * gravity);
  return SE23<S>(back * SO3<S>(second.so3()), position, velocity);
}

/// The states in a world that turns at `world_rate` (rad/s, in its axes; the Earth's, east, north and up, is 7.292e-5
/// times (0, cos latitude, sin latitude)) as impliedIncrement() wants them: in axes that coincide with the world's at
/// the first state and do not turn. Gravity is that of the turning world, with the centrifugal acceleration at its
/// origin; where it points during the interval is in the second state. Gravity's gains to the second power of the
/// angle.
template <class S>
std::pair<SE23<S>, SE23<S>> statesInFixedAxes(const SE23<S>& first, const SE23<S>& second, const S& t,
                                              const Eigen::Matrix<S, 3, 1>& gravity,
                                              const Eigen::Matrix<S, 3, 1>& world_rate) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  const Vector3 angle = t * world_rate;
  const SO3<S> turn = SO3<S>::exp(angle);
  const Vector3 once = angle.cross(gravity), twice = angle.cross(once);
  const Vector3 p = first.translation(), q = second.translation();
  return {SE23<S>(SO3<S>(first.so3()), p, Vector3(first.velocity() + world_rate.cross(p))),
          SE23<S>(turn * SO3<S>(second.so3()), Vector3(turn * q - (t * t) * (S(1. / 6) * once + S(1. / 24) * twice)),
                  Vector3(turn * Vector3(second.velocity() + world_rate.cross(q)) -
                          t * (S(0.5) * once + S(1. / 6) * twice)))};
}

/// The residual alone; through Jets too, in the states, the biases and gravity.
template <class T, class S>
Eigen::Matrix<T, 9, 1> preintegrationError(const Preintegration<S>& motion, const SE23<T>& first, const SE23<T>& second,
                                           const ImuBias<T>& bias, const Eigen::Matrix<T, 3, 1>& gravity) {
  return (motion.template increment<T>(bias).inverse() *
          impliedIncrement<T>(first, second, T(motion.duration()), gravity))
      .log();
}

/// The residual with all its derivatives.
template <class S>
PreintegrationResidual<S> preintegrationResidual(const Preintegration<S>& motion, const SE23<S>& first,
                                                 const SE23<S>& second, const ImuBias<S>& bias,
                                                 const Eigen::Matrix<S, 3, 1>& gravity) {
  using Matrix9 = Eigen::Matrix<S, 9, 9>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;
  const S t = motion.duration();
  const SE23<S> implied = impliedIncrement(first, second, t, gravity);
  PreintegrationResidual<S> r;
  r.value = (motion.increment(bias).inverse() * implied).log();
  r.by_second = SE23<S>::rightJacobianInverse(r.value);
  // Φ_t(X Exp d) = Φ_t(X) Exp(F d): a velocity carries the position along.
  Matrix9 F = Matrix9::Identity();
  F.template block<3, 3>(0, 6) = t * Matrix3::Identity();
  r.by_first = -detail::product(detail::product(r.by_second, implied.inverse().Adj()), F);
  r.by_bias = -detail::product(SE23<S>::leftJacobianInverse(r.value), motion.biasJacobian(bias));
  const Matrix3 back = second.so3().matrix().transpose();
  Eigen::Matrix<S, 9, 3> by_gravity;
  by_gravity << -(S(0.5) * t * t) * back, Matrix3::Zero(), -t * back;
  r.by_gravity = detail::product(r.by_second, by_gravity);
  return r;
}

}  // namespace liestat
