#pragma once

#include <cli/io/calibration.hpp>
#include <cli/io/image_tracks.hpp>
#include <cli/io/imu_file.hpp>
#include <fusion/noise_calibration.hpp>
#include <fusion/visual_inertial_types.hpp>

#include <cstddef>
#include <optional>
#include <vector>

namespace liestat::cli {

/// The input of `liestat vi-init`. Times of images are on the inertial sensor's clock.
struct ViRecording {
  ImuFile imu;
  ImageTracks tracks;
  CameraCalibration camera;
  bool pose_assumed = false;  ///< no calibration has the camera's pose on the sensor: it is taken as the identity
  ImuNoise<double> noise;
  std::vector<GroundTruth> truth;  ///< empty: not known
};

/// The errors of an estimate against the ground truth.
struct ViError {
  double speed = 0;    ///< m/s, of the velocity at the first image
  double gravity = 0;  ///< rad, of its direction
  double scale = 0;    ///< relative, of the trajectory of the window: (Σ p·p_true)/(Σ p_true²) − 1
};

/// One window, compared with the ground truth where that is known.
struct ViWindow : InitialisedWindow {
  std::optional<ViError> closed_form_error, refined_error;
  std::optional<double> gyroscope_error;  ///< rad/s, of the best known bias
  std::optional<double> nees;             ///< the refined V and G's, 5 degrees of freedom
};

/// The state that disjoint windows give together, compared with the ground truth where that is known.
struct ViFusion : FusedStretch {
  /// In the body's axes: a unit vector, m/s, rad/s, m/s², with the RMS of the standard deviations of their coordinates.
  Eigen::Vector3d down, velocity, gyroscope_bias, accelerometer_bias;
  double down_sigma = 0, velocity_sigma = 0, gyroscope_sigma = 0, accelerometer_sigma = 0;
  std::optional<double> speed_error, gravity_error, gyroscope_error, accelerometer_error;  ///< m/s, rad, rad/s, m/s²
  std::optional<double> nees;                                                              ///< 11 degrees of freedom
};

/// The result that the command shows.
struct ViInitResult {
  std::vector<ViWindow> windows;
  std::vector<ViFusion> fusions;
  std::optional<double> gravity;          ///< |G| that was given, m/s²
  bool biases_given = false;              ///< and not estimated
  std::optional<NoiseCalibration> noise;  ///< where it was asked for
  double bearing_noise = 0;               ///< rad
  std::size_t images_outside = 0;         ///< that the readings do not cover
  std::size_t observations_outside = 0;   ///< pixels that the lens' model can't explain
  std::size_t windows_left = 0;           ///< not estimated, because of an interrupt

  std::size_t okWindows() const;
  /// Nothing was interrupted, a window is ok, and where windows were fused, those of a stretch agree.
  bool trusted() const;
};

/// Compares what was found with the recording's ground truth; gravity's length in m/s², none: it was not known.
ViInitResult compareWithTruth(VisualInertialResult found, const ViRecording& recording, std::optional<double> gravity);

/// Throws an InputError in the command's name for the fault of a recording as a whole.
void refuseFault(const VisualInertialResult& found, const VisualInertialRecording& measured, std::int64_t start_ns,
                 const VisualInertialOptions& how, const char* command);

}  // namespace liestat::cli
