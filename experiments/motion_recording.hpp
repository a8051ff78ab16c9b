// A scene of experiments/motion_scene.hpp as a recording: tracks in pixels, times, the camera's poses, rotation rates at
// the frames, and the readings of an inertial sensor on the camera.
#pragma once

#include <experiments/motion_scene.hpp>
#include <experiments/recording.hpp>
#include <fusion/imu/readings.hpp>
#include <lie/se3.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <vector>

namespace liestat::experiments {

struct MotionRecordingOptions {
  MotionSceneOptions scene;                                  ///< gyroscope_sigma > 0; its gyroscope_bias is not used
  std::size_t frames = 100;                                  ///< at least 2
  double frame_rate = 10, imu_rate = 200;                    ///< Hz
  Eigen::Vector3d gyroscope_bias = Eigen::Vector3d::Zero();  ///< rad/s, in the sensor's axes
  std::uint64_t seed = 1, trial = 0;
};

struct MotionRecording {
  struct Observation {
    std::size_t frame = 0, track = 0;
    double u = 0, v = 0;  ///< px
    bool inlier = true;   ///< its flow from the frame before is right
  };
  struct Frame {
    double time = 0;                                      ///< s
    SE3d camera_T_world;                                  ///< lengths are metres
    Eigen::Vector3d true_rate = Eigen::Vector3d::Zero();  ///< rad/s, in the sensor's axes
    Eigen::Vector3d rate = Eigen::Vector3d::Zero();       ///< the same as measured, with bias and noise
  };

  std::vector<Observation> observations;  ///< by frames, then by tracks
  std::vector<Frame> frames;
  std::vector<ImuSample<double>> imu;  ///< from before the first frame to after the last
  /// The sensor's axes are those of a vehicle under a camera that looks ahead: x forward, y left, z up. Both sit in one
  /// place.
  CameraCalibration camera;
  ImuNoise<double>
      noise;  ///< densities that make gyroscope_sigma per frame; of the accelerometer those of an ADIS16448
};

/// Rates between frames are those of the scene, constant over an interval; at a frame the mean of both its intervals.
/// A rate of `frames` has √2 gyroscope_sigma per frame, so that the mean of two has gyroscope_sigma. Outliers are of
/// flows, as in the scene: a track that jumps ends, and its point goes on as another track.
MotionRecording recordMotion(const MotionRecordingOptions& options);

}  // namespace liestat::experiments
