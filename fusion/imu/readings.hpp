// The readings of an inertial measurement unit, its biases and its noise.
#pragma once

#include <Eigen/Core>

namespace liestat {

/// One reading: at a time (s), the angular rate (rad/s) and the specific force (m/s²), both in the sensor's axes. The
/// specific force is the acceleration less gravity: at rest it points upwards, with 9.8 m/s².
template <class S>
struct ImuSample {
  S time = S(0);
  Eigen::Matrix<S, 3, 1> angular_rate = Eigen::Matrix<S, 3, 1>::Zero();
  Eigen::Matrix<S, 3, 1> specific_force = Eigen::Matrix<S, 3, 1>::Zero();
};

/// The bias that a sensor adds: measured = true + bias + noise. Coordinates (gyroscope rad/s, accelerometer m/s²).
template <class S>
struct ImuBias {
  Eigen::Matrix<S, 3, 1> gyroscope = Eigen::Matrix<S, 3, 1>::Zero();
  Eigen::Matrix<S, 3, 1> accelerometer = Eigen::Matrix<S, 3, 1>::Zero();
};

/// Densities of white noise, as data sheets give them: a reading of a sensor that gives `rate` of them per second has a
/// standard deviation of density·√rate.
template <class S>
struct ImuNoise {
  S gyroscope = S(0);      ///< rad/s/√Hz
  S accelerometer = S(0);  ///< m/s²/√Hz
  /// Random walk of the biases: over t seconds they change by density·√t.
  S gyroscope_walk = S(0);      ///< rad/s²/√Hz
  S accelerometer_walk = S(0);  ///< m/s³/√Hz
};

}  // namespace liestat
