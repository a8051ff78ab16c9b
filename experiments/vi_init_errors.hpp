#pragma once

// What a solution of visual-inertial initialisation is wrong by.

#include <fusion/init/closed_form_types.hpp>
#include <fusion/detail/closed_form_input.hpp>
#include <fusion/imu/readings.hpp>
#include <experiments/inertial_scene.hpp>
#include <stats/gaussian.hpp>

#include <Eigen/Core>

#include <array>
#include <cmath>
#include <limits>

namespace liestat::experiments {

/// Densities of an ADIS16448, as its data sheet and EuRoC's calibration have them, rounded.
inline constexpr ImuNoise<double> vi_init_imu{.gyroscope = 1.7e-4, .accelerometer = 2e-3};

inline constexpr double degrees_per_radian = 57.29577951308232;

/// Errors of speed (m/s), gravity's direction (deg) and scale (%).
struct ViErrors {
  double speed = std::numeric_limits<double>::infinity();
  double gravity = std::numeric_limits<double>::infinity();
  double scale = std::numeric_limits<double>::infinity();
};

inline ViErrors viErrors(const Eigen::Vector3d& velocity, const Eigen::Vector3d& gravity, const InertialScene& truth) {
  const double angle = std::atan2(gravity.cross(truth.gravity).norm(), gravity.dot(truth.gravity));
  return {(velocity - truth.velocity).norm(), angle * degrees_per_radian,
          100 * std::abs(velocity.norm() / truth.velocity.norm() - 1)};
}

/// A window without a solution counts as lost: its errors are infinite.
inline ViErrors viErrors(const ClosedFormResult& result, const InertialScene& truth) {
  if (result.solutions.empty()) return {};
  return viErrors(result.solutions[0].velocity, result.solutions[0].gravity, truth);
}

/// Squared Mahalanobis distance of an error of (V, G, …) of size N + 1 with N degrees of freedom: gravity is on its
/// sphere, where its covariance has no part along it. `covariance` has N + 1 rows at least; the first ones are used.
template <int N, class Covariance>
double neesOnSphere(const Eigen::Matrix<double, N + 1, 1>& error, const Covariance& covariance,
                    const Eigen::Vector3d& gravity) {
  Eigen::Matrix<double, N, N + 1> reduce = Eigen::Matrix<double, N, N + 1>::Zero();
  reduce.template topLeftCorner<3, 3>().setIdentity();
  reduce.template block<2, 3>(3, 3) = detail::tangentRows(gravity.normalized());
  reduce.template bottomRightCorner<N - 5, N - 5>().setIdentity();
  const Eigen::Matrix<double, N + 1, N + 1> whole = covariance.template topLeftCorner<N + 1, N + 1>();
  const Eigen::Matrix<double, N + 1, N> half = whole * reduce.transpose();
  return mahalanobisSquared<double, N>(Eigen::Matrix<double, N, 1>(reduce * error),
                                       Eigen::Matrix<double, N, N>(reduce * half));
}

}  // namespace liestat::experiments
