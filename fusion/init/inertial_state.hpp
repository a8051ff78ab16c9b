// The state of a body that a camera and an inertial sensor tell without a map, as a manifold.
#pragma once

#include <lie/detail/small_products.hpp>
#include <lie/product.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <stats/gaussian.hpp>

#include <Eigen/Core>

namespace liestat {

/// The state of a body that a camera and an inertial sensor tell without a map; position and heading, which they do
/// not tell, are not in it. All in the body's axes: the direction of gravity (downwards), the velocity (m/s), the
/// gyroscope's bias (rad/s), and the resting force: what the accelerometer would read at rest, its bias less gravity
/// (m/s²). That is known much better than either of the two, which only the rotation of a window tells apart: bias and
/// direction would be known along a line that follows gravity's sphere, and a Gaussian is straight. Tangent: 2 + 3 + 3
/// + 3.
using InertialState = Product<S2d, Eigen::Vector3d, Eigen::Vector3d, Eigen::Vector3d>;

namespace detail {

/// From coordinates at a direction to the change of its unit vector.
inline Eigen::Matrix<double, 3, 2> directionBasis(const S2d& direction) {
  return ManifoldTraits<S2d>::placement(direction).matrix().leftCols<2>();
}

/// From changes of (unit vector downwards, velocity, biases) to the tangent of the state, and back.
inline Eigen::Matrix<double, 11, 12> toInertialTangent(const S2d& direction, double gravity) {
  Eigen::Matrix<double, 11, 12> J = Eigen::Matrix<double, 11, 12>::Zero();
  J.block<2, 3>(0, 0) = directionBasis(direction).transpose();
  J.block<9, 9>(2, 3).setIdentity();
  J.block<3, 3>(8, 0) = -gravity * Eigen::Matrix3d::Identity();
  return J;
}
inline Eigen::Matrix<double, 12, 11> fromInertialTangent(const S2d& direction, double gravity) {
  Eigen::Matrix<double, 12, 11> J = Eigen::Matrix<double, 12, 11>::Zero();
  J.block<3, 2>(0, 0) = directionBasis(direction);
  J.block<9, 9>(3, 2).setIdentity();
  J.block<3, 2>(9, 0) = gravity * directionBasis(direction);
  return J;
}

}  // namespace detail

/// The accelerometer's bias of a state (m/s²), gravity's length in m/s²; with its covariance.
inline Eigen::Vector3d accelerometerBias(const InertialState& state, double gravity) {
  return state.get<3>() + gravity * state.get<0>().unit_vector();
}
inline Gaussian<Eigen::Vector3d> accelerometerBias(const Gaussian<InertialState>& state, double gravity) {
  const Eigen::Matrix<double, 3, 11> J = detail::fromInertialTangent(state.mean.get<0>(), gravity).bottomRows<3>();
  return {accelerometerBias(state.mean, gravity), detail::congruence(J, state.covariance)};
}

}  // namespace liestat
