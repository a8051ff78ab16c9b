#pragma once

// The errors of a solution of visual-inertial initialisation, and their normalised squares.

#include <fusion/init/closed_form_types.hpp>
#include <fusion/imu/readings.hpp>
#include <experiments/inertial_scene.hpp>
#include <experiments/vi_init_trials.hpp>
#include <lie/units.hpp>
#include <stats/gaussian.hpp>
#include <fusion/visual_inertial_truth.hpp>

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

}  // namespace liestat::experiments
