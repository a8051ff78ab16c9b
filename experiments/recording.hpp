// The data of a recording of an inertial sensor and a camera, whether they are simulated or read from files.
#pragma once

#include <fusion/camera.hpp>
#include <fusion/imu/ground_truth.hpp>
#include <fusion/imu/readings.hpp>
#include <lie/se3.hpp>

#include <cstddef>
#include <string>

namespace liestat::experiments {

/// Noise densities of an ADIS16448, the sensor of EuRoC's recordings, as its data sheet and EuRoC's calibration say.
inline constexpr ImuNoise<double> adis16448{
    .gyroscope = 1.6968e-4, .accelerometer = 2e-3, .gyroscope_walk = 1.9393e-5, .accelerometer_walk = 3e-3};

/// A landmark's image, in pixels.
struct PixelObservation {
  std::size_t image = 0;  ///< counts the images from 0
  std::size_t track = 0;  ///< counts the tracks from 0
  double u = 0;
  double v = 0;
  std::size_t line = 0;  ///< line in the file that it was read from; 0: none
};

/// A camera and where it sits on the inertial sensor.
struct CameraCalibration {
  std::string name;  ///< as its file calls it, cam0
  Camera camera;
  SE3d imu_T_cam;                ///< takes the camera's coordinates to the sensor's, m
  double timeshift_cam_imu = 0;  ///< s: t_imu = t_cam + this
};

/// Where no calibration is given: a pinhole that looks along the body's x axis.
CameraCalibration defaultCamera();

}  // namespace liestat::experiments
