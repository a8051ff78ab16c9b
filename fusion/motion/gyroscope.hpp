// The rotation that a gyroscope measured between two frames, in the sign and the axes of fusion/motion/: that of the
// points as the camera sees them, camera2_R_camera1 = Exp(Ω_g).
#pragma once

#include <fusion/imu/preintegration.hpp>
#include <fusion/motion/types.hpp>

#include <Eigen/Core>

namespace liestat {

/// The rotation of preintegrated readings from the time of the first frame to that of the second.
/// `camera_R_imu` takes the sensor's axes to the camera's. The covariance is that of an error on the left, Exp(n) Exp(Ω_g),
/// along the second frame's axes; it is only positive definite if the noise of the readings was given.
inline GyroscopeRotation gyroscopeRotation(const Preintegration<double>& motion, const SO3d& camera_R_imu) {
  const Eigen::Matrix3d R = camera_R_imu.matrix();
  // ΔR takes the sensor's axes at the end to those at the start; ΔR Exp(e) makes R (ΔR Exp(e))⁻¹ Rᵀ = Exp(-R e) Exp(Ω_g).
  return {-(R * motion.increment().so3().log()),
          R * Eigen::Matrix3d(motion.gaussian().covariance.block<3, 3>(3, 3)) * R.transpose()};
}

/// Of a constant rate (rad/s, in the sensor's axes) over so many seconds, with a standard deviation of each component of
/// the rate (rad/s).
inline GyroscopeRotation gyroscopeRotation(const Eigen::Vector3d& rate, double seconds, double sigma,
                                           const SO3d& camera_R_imu) {
  const double s = sigma * seconds;
  return {-seconds * (camera_R_imu.matrix() * rate), s * s * Eigen::Matrix3d::Identity()};
}

/// The bias of the readings (rad/s, in the sensor's axes) from MotionEstimate::gyroscope_bias: measured minus true.
inline Eigen::Vector3d gyroscopeBiasRate(const Eigen::Vector3d& bias, double seconds, const SO3d& camera_R_imu) {
  return camera_R_imu.matrix().transpose() * bias / -seconds;
}

}  // namespace liestat
