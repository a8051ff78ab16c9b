// Calibrations of cameras and inertial sensors from YAML files: Kalibr, OpenVINS, TUM-VI, EuRoC.
//
//   const liestat::Calibration calibration = liestat::readCalibration({"camchain-imucam.yaml", "imu.yaml"});
#pragma once

#include <fusion/camera_calibration.hpp>
#include <fusion/imu/readings.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

/// The contents of calibration files.
struct Calibration {
  std::optional<ImuNoise<double>> imu;
  std::vector<CameraCalibration> cameras;  ///< in the order of the files
};

/// Reads one file or several that belong together: chains of cameras by Kalibr (camchain-imucam), OpenVINS and TUM-VI,
/// chains of sensors (imu0), and the sensor.yaml of EuRoC's cameras and IMU. The pose of a camera is read from the key
/// that is there: T_imu_cam takes the camera's coordinates to the sensor's, T_cam_imu is its inverse, T_BS takes them
/// to the body, whose axes are the sensor's unless the sensor has a T_BS of its own. Throws InputError with the line:
/// where what is needed is missing or contradicts itself, where a rotation is none (one that is off by rounding is
/// projected), where numbers are too few or not finite, where a camera is no pinhole (with radtan, equidistant or no
/// distortion), and where two files have the same camera or an IMU each.
Calibration readCalibration(const std::vector<std::string>& paths);
/// The cameras of one file, wherever they sit: those above, of which none needs a pose, and intrinsics by OpenCV's
/// FileStorage (YAML, or XML) or ROS (camera_info): camera_matrix, distortion_coefficients, image_width, image_height.
/// Throws InputError as above, and where a camera has coefficients of distortion beyond k1 k2 p1 p2 k3.
std::vector<CameraCalibration> readCameras(const std::string& path);
/// The same from memory.
std::vector<CameraCalibration> parseCameras(std::string_view text, const std::string& name);

/// One file from memory; `name` stands for it in messages.
Calibration parseCalibration(std::string_view text, const std::string& name);

/// Reads gyroscope_noise_density, gyroscope_random_walk, accelerometer_noise_density and accelerometer_random_walk out
/// of a YAML file: EuRoC's sensor.yaml, or the section imu0 of Kalibr's and OpenVINS' chains. OpenCV's first line
/// %YAML:1.0 is passed over. Throws InputError with the line, where a density is missing or not a number of zero or
/// more.
ImuNoise<double> readImuNoise(const std::string& path);
/// The same from memory.
ImuNoise<double> parseImuNoise(std::string_view text, const std::string& name);

}  // namespace liestat
