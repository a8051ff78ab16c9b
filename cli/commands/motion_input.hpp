#pragma once

// The input of `liestat motion`: tracks in calibrated coordinates, and what a gyroscope says of the rotation between frames.

#include <formats/calibration.hpp>
#include <fusion/motion/gyroscope.hpp>
#include <fusion/motion/sequence.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// Names of the axes in which rotation rates are given.
enum class RateAxes {
  camera,  ///< x right, y down, z forward
  vehicle  ///< x forward, y left, z up, over a camera that looks forward
};

struct MotionInputOptions {
  std::string tracks, rates, imu, image_times;
  std::vector<std::string> calibration;
  std::vector<double> intrinsics;
  std::vector<double> rates_rotation;          ///< x,y,z,w: takes the rates' axes to the camera's, in place of `axes`
  std::vector<double> camera_tilt;             ///< deg: roll, pitch, yaw of the camera on the vehicle
  std::vector<double> gyroscope_bias;          ///< rad/s, taken off the readings
  std::optional<double> gyroscope_noise = {};  ///< rad/s/√Hz, goes before the calibration's
  RateAxes axes = RateAxes::camera;
  std::optional<double> sigma = {};  ///< px; goes before the tracks' own, which go before 0.5
  double rate_sigma = 0.1;           ///< deg per frame
  double largest_gap = 0.1;          ///< s between two readings
};

/// Tracks frame by frame.
struct MotionTracks {
  TrackFrames frames;       ///< by their numbers in the file
  std::size_t outside = 0;  ///< observations for which the camera's model has no ray ahead; left out
};

struct MotionInput {
  MotionTracks tracks;
  MotionGyroscope gyroscope;
  std::string gyroscope_file;
};

/// Reads the files that the options name. Throws InputError or OptionError, also where focal lengths and image coordinates are in
/// different units, where there is one frame, and where an inertial sensor's readings cover none of the intervals.
MotionInput readMotionInput(const MotionInputOptions& options);

}  // namespace liestat::cli
