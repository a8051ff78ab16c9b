#pragma once

// The errors of a solution of visual-inertial initialisation, and their normalised squares.

#include <fusion/init/closed_form_types.hpp>
#include <fusion/imu/readings.hpp>
#include <experiments/inertial_scene.hpp>
#include <experiments/vi_init_trials.hpp>
#include <lie/units.hpp>
#include <stats/gaussian.hpp>
#include <fusion/init/filter_start.hpp>
#include <fusion/visual_inertial_truth.hpp>
#include <stats/random.hpp>

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

/// The heading and position, which are free, of the filters' starts in the trials.
inline const FilterStartOptions vi_init_filter_start{
    .position = {1, -2, 0.5}, .heading = 0.7, .position_sigma = 0.1, .heading_sigma = 0.02};

/// NEES of a filter's start at the scene's time t, 15 degrees of freedom. The filter's world is free: position and heading
/// in it are drawn with the standard deviations of the options, and from rest what the body shakes.
inline double neesOfFilterStart(const Gaussian<InertialState>& state, bool from_rest, const InertialScene& scene,
                                double t, const ImuBias<double>& bias, CounterRng& rng) {
  const FilterStartOptions& options = vi_init_filter_start;
  Gaussian<InertialState> at_start = state;
  Eigen::Vector3d velocity = scene.speed(t);
  if (from_rest) {
    const double sigma = options.rest_speed_sigma;
    at_start.covariance.block<3, 3>(2, 2).diagonal().array() += sigma * sigma;
    velocity += sigma * rng.normalVector<3>();
  }
  const FilterStart start = filterStart(at_start, InertialScene::g, t, options);
  if (!start.ok()) return std::numeric_limits<double>::quiet_NaN();
  // The filter's world is turned about its vertical until the heading's error is the one drawn.
  const SO3d found(start.state.so3());
  const double heading = options.heading_sigma * rng.normal();
  SO3d turn;
  for (int pass = 0; pass < 5; ++pass) {
    const Eigen::Vector3d off = found * Eigen::Vector3d((found.inverse() * turn * scene.attitude(t)).log());
    turn = SO3d::exp(Eigen::Vector3d(0, 0, heading - off.z())) * turn;
  }
  const Eigen::Vector3d position = options.position + options.position_sigma * rng.normalVector<3>();
  const SE23d truth(turn * scene.attitude(t), position, turn * velocity);
  Eigen::Matrix<double, 15, 1> error;
  error << (start.state.inverse() * truth).log(), bias.gyroscope - start.bias.gyroscope,
      bias.accelerometer - start.bias.accelerometer;
  return mahalanobisSquared<double, 15>(error, start.covariance);
}

}  // namespace liestat::experiments
