// A camera on an inertial sensor, and what it sees in pixels: what files of calibrations and tracks hold.
#pragma once

#include <fusion/camera.hpp>
#include <lie/se3.hpp>

#include <cstddef>
#include <string>

namespace liestat {

/// A landmark's image, in pixels.
struct PixelObservation {
  std::size_t image = 0;  ///< counts the images from 0
  std::size_t track = 0;  ///< counts the tracks from 0
  double u = 0;
  double v = 0;
  std::size_t line = 0;  ///< line in the file that it was read from; 0: none
  double sigma = 0;      ///< px: standard deviation of u and of v; 0: not known
};

/// A camera and where it sits on the inertial sensor.
struct CameraCalibration {
  std::string name;  ///< as its file calls it, cam0
  Camera camera;
  SE3d imu_T_cam;                ///< takes the camera's coordinates to the sensor's, m
  double timeshift_cam_imu = 0;  ///< s: t_imu = t_cam + this
};

}  // namespace liestat
