#pragma once

// The errors of a solution of visual-inertial initialisation, and their normalised squares.

#include <fusion/init/closed_form_types.hpp>
#include <fusion/imu/readings.hpp>
#include <experiments/inertial_scene.hpp>
#include <experiments/vi_init_trials.hpp>
#include <lie/units.hpp>
#include <stats/gaussian.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>

namespace liestat::experiments {

/// Densities of an ADIS16448, as its data sheet and EuRoC's calibration have them, rounded.
inline constexpr ImuNoise<double> vi_init_imu{.gyroscope = 1.7e-4, .accelerometer = 2e-3};
/// The same with the walks of its biases.
inline constexpr ImuNoise<double> vi_init_walking_imu{
    .gyroscope = 1.7e-4, .accelerometer = 2e-3, .gyroscope_walk = 1.9393e-5, .accelerometer_walk = 3e-3};

/// The errors of a velocity and a gravity in the body's axes at the first image.
inline ViErrors viErrors(const Eigen::Vector3d& velocity, const Eigen::Vector3d& gravity, const InertialScene& truth) {
  const double angle = std::atan2(gravity.cross(truth.gravity).norm(), gravity.dot(truth.gravity));
  return {(velocity - truth.velocity).norm(), angle / units::degree,
          100 * std::abs(velocity.norm() / truth.velocity.norm() - 1)};
}

/// A window without a solution counts as lost: its errors are infinite.
inline ViErrors viErrors(const ClosedFormResult& result, const InertialScene& truth) {
  if (result.solutions.empty()) return {};
  return viErrors(result.solutions[0].velocity, result.solutions[0].gravity, truth);
}

/// Squared Mahalanobis distance (NEES) of an error of (V, G, …) of size N + 1 with N degrees of freedom: gravity is on
/// its sphere, where its covariance has no part along it. `covariance` has N + 1 rows at least, in the order of the
/// error; the first ones are used. NaN unless it is positive definite across gravity. The one place where the errors of
/// a visual-inertial initialisation are normalised.
template <int N, class Covariance>
double neesOnSphere(const Eigen::Matrix<double, N + 1, 1>& error, const Covariance& covariance,
                    const Eigen::Vector3d& gravity) {
  // Any two axes across gravity do.
  const Eigen::Vector3d across = gravity.unitOrthogonal();
  Eigen::Matrix<double, N, N + 1> reduce = Eigen::Matrix<double, N, N + 1>::Zero();
  reduce.template topLeftCorner<3, 3>().setIdentity();
  reduce.template block<1, 3>(3, 3) = across.transpose();
  reduce.template block<1, 3>(4, 3) = gravity.normalized().cross(across).transpose();
  reduce.template bottomRightCorner<N - 5, N - 5>().setIdentity();
  const Eigen::Matrix<double, N + 1, N + 1> whole = covariance.template topLeftCorner<N + 1, N + 1>();
  const Eigen::Matrix<double, N + 1, N> half = whole * reduce.transpose();
  return mahalanobisSquared<double, N>(Eigen::Matrix<double, N, 1>(reduce * error),
                                       Eigen::Matrix<double, N, N>(reduce * half));
}

}  // namespace liestat::experiments
