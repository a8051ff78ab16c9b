// The exact error coordinates of a convention, of which conventionJacobian (stats/conventions.hpp) is the derivative.
//
// A covariance is that of its own coordinates: above a rotation of some 0.1 rad (one sigma) the coordinates of two
// conventions are no longer linear functions of each other, and x = conventionLog(c, T_hat, T) with xᵀ C⁻¹ x keeps the
// law that a converted covariance loses. docs/theory/conventions.md, section 3.
#pragma once

#include <stats/conventions.hpp>

#include <cmath>

namespace liestat {
namespace detail {

/// The angles' difference in [-π, π].
inline double angleDifference(double to, double from) {
  return std::remainder(to - from, 2 * static_cast<double>(EIGEN_PI));
}

/// The rotation vector of R that is nearest to another: Log(R), or the one that turns the other way.
inline Eigen::Vector3d rotationVectorNear(const SO3d& R, const Eigen::Vector3d& near) {
  Eigen::Vector3d v = R.log();
  const double angle = v.norm();
  if (!(angle > 0)) return v;
  Eigen::Vector3d other = v * (1 - 2 * static_cast<double>(EIGEN_PI) / angle);
  if ((other - near).squaredNorm() < (v - near).squaredNorm()) return other;
  return v;
}

}  // namespace detail

/// The error coordinates x that lead from T_hat to T, in the convention's order and unit (m, and the unit of the
/// rotation); zero for T = T_hat. Euler angles are taken modulo 2π, of rotation vectors the one nearest to that of
/// T_hat.
inline Eigen::Matrix<double, 6, 1> conventionLog(const Convention& convention, const SE3d& T_hat, const SE3d& T) {
  const SO3d R_hat = T_hat.so3(), R = T.so3();
  Eigen::Vector3d translation = T.translation() - T_hat.translation();
  Eigen::Vector3d rotation;
  switch (convention.perturbation) {
    case Perturbation::right:
    case Perturbation::transposed_axes:
    case Perturbation::left: {
      const bool left = convention.perturbation == Perturbation::left;
      const Eigen::Matrix<double, 6, 1> xi = left ? (T * T_hat.inverse()).log() : (T_hat.inverse() * T).log();
      translation = xi.head<3>();
      rotation = xi.tail<3>();
      if (convention.perturbation == Perturbation::transposed_axes) {
        translation = R_hat.inverse() * translation;
        rotation = R_hat.inverse() * rotation;
      }
      break;
    }
    case Perturbation::body_axes:
      translation = R_hat.inverse() * translation;
      rotation = (R_hat.inverse() * R).log();
      break;
    case Perturbation::world_axes:
      rotation = (R * R_hat.inverse()).log();
      break;
    case Perturbation::world_axes_reversed:
      rotation = (R_hat * R.inverse()).log();
      break;
    case Perturbation::world_body_axes:
      rotation = (R_hat.inverse() * R).log();
      break;
    case Perturbation::roll_pitch_yaw:
    case Perturbation::yaw_pitch_roll: {
      const Eigen::Vector3d to = toRollPitchYaw(R), from = toRollPitchYaw(R_hat);
      const bool reversed = convention.perturbation == Perturbation::yaw_pitch_roll;
      for (int i = 0; i < 3; ++i) rotation[reversed ? 2 - i : i] = detail::angleDifference(to[i], from[i]);
      break;
    }
    case Perturbation::rotation_vector: {
      const Eigen::Vector3d from = R_hat.log();
      rotation = detail::rotationVectorNear(R, from) - from;
      break;
    }
  }
  const int t = convention.order == CovarianceOrder::translation_rotation ? 0 : 3;
  Eigen::Matrix<double, 6, 1> x;
  x.segment<3>(t) = translation;
  x.segment<3>(3 - t) = unitsPerRadian(convention.unit) * rotation;
  return x;
}

/// The pose at error coordinates x from T_hat; inverse of conventionLog.
inline SE3d conventionExp(const Convention& convention, const SE3d& T_hat, const Eigen::Matrix<double, 6, 1>& x) {
  const int t = convention.order == CovarianceOrder::translation_rotation ? 0 : 3;
  const SO3d R = T_hat.so3();
  const Eigen::Vector3d p = T_hat.translation();
  const Eigen::Vector3d translation = x.segment<3>(t);
  const Eigen::Vector3d rotation = x.segment<3>(3 - t) / unitsPerRadian(convention.unit);
  Eigen::Matrix<double, 6, 1> xi;
  xi << translation, rotation;
  switch (convention.perturbation) {
    case Perturbation::right:
      break;
    case Perturbation::transposed_axes:
      xi << R * translation, R * rotation;
      break;
    case Perturbation::left:
      return SE3d::exp(xi) * T_hat;
    case Perturbation::body_axes:
      return SE3d(R * SO3d::exp(rotation), p + R * translation);
    case Perturbation::world_axes:
      return SE3d(SO3d::exp(rotation) * R, p + translation);
    case Perturbation::world_axes_reversed:
      return SE3d(SO3d::exp(-rotation) * R, p + translation);
    case Perturbation::world_body_axes:
      return SE3d(R * SO3d::exp(rotation), p + translation);
    case Perturbation::roll_pitch_yaw:
    case Perturbation::yaw_pitch_roll: {
      Eigen::Vector3d angles = toRollPitchYaw(R);
      const bool reversed = convention.perturbation == Perturbation::yaw_pitch_roll;
      for (int i = 0; i < 3; ++i) angles[i] += rotation[reversed ? 2 - i : i];
      return SE3d(fromRollPitchYaw(angles[0], angles[1], angles[2]), p + translation);
    }
    case Perturbation::rotation_vector:
      return SE3d(SO3d::exp(R.log() + rotation), p + translation);
  }
  return T_hat * SE3d::exp(xi);
}

}  // namespace liestat
