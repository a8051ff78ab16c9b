// The data of a recording of an inertial sensor and a camera, whether they are simulated or read from files.
#pragma once

#include <fusion/camera_calibration.hpp>
#include <fusion/imu/ground_truth.hpp>
#include <fusion/imu/readings.hpp>

namespace liestat::experiments {

/// Noise densities of an ADIS16448, the sensor of EuRoC's recordings, as its data sheet and EuRoC's calibration say.
inline constexpr ImuNoise<double> adis16448{
    .gyroscope = 1.6968e-4, .accelerometer = 2e-3, .gyroscope_walk = 1.9393e-5, .accelerometer_walk = 3e-3};

/// Where no calibration is given: a pinhole that looks along the body's x axis.
CameraCalibration defaultCamera();

}  // namespace liestat::experiments
