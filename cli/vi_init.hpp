#pragma once

#include <fusion/imu/preintegrate.hpp>
#include <fusion/init/refinement.hpp>
#include <fusion/init/robust_initialisation.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <cli/io/calibration.hpp>
#include <cli/io/image_tracks.hpp>
#include <cli/io/imu_file.hpp>

namespace liestat::cli {

/// What `liestat vi-init` works on. Times of images are on the inertial sensor's clock.
struct ViRecording {
  ImuFile imu;
  ImageTracks tracks;
  CameraCalibration camera;
  ImuNoise<double> noise;
  std::vector<GroundTruth> truth;  ///< empty: not known
};

struct ViInitOptions {
  double window = 2;          ///< s
  double stride = 0;          ///< s from the start of a window to that of the next; 0: the window
  double image_rate = 10;     ///< Hz: of the images that are used, at most
  std::size_t features = 50;  ///< a window; those that were seen most often are taken
  std::size_t least_observations = 4;
  double pixel_noise = 1;  ///< pixels, standard deviation in u and in v
  std::optional<double> gravity = 9.81;
  ImuBias<double> prior = {};             ///< biases as they are expected, and their deviations
  double gyroscope_deviation = 0.1;       ///< rad/s
  double accelerometer_deviation = 0.15;  ///< m/s²
  bool known_biases = false;              ///< the prior is the truth: nothing is estimated
  bool true_biases = false;               ///< the same with the ground truth's, window by window
  bool consensus = true;                  ///< tracks may be wrong
  bool refinement = true;
  double noise_factor = 1;  ///< of the inertial sensor's densities
  double stretch = 12;      ///< s: windows that are fused
  ImuScheme scheme = ImuScheme::averaged;
  double largest_gap = 0.1;          ///< s, between readings
  std::optional<double> begin, end;  ///< s
  std::uint64_t seed = 1;
};

/// How far an estimate is from the ground truth.
struct ViError {
  double speed = 0;    ///< m/s, of the velocity at the first image
  double gravity = 0;  ///< rad, of its direction
  double scale = 0;    ///< relative, of the trajectory of the window: (Σ p·p_true)/(Σ p_true²) − 1
};

/// One window.
struct ViWindow {
  double begin = 0, end = 0;  ///< s, of its first and last image
  Fault fault = FaultKind::none;
  double fault_time = 0;            ///< s
  std::vector<std::size_t> images;  ///< of the recording's
  std::vector<std::size_t> tracks;  ///< of the recording's; features of the results in this order
  InertialWindow measured;          ///< integrated with `integrated`
  ImuBias<double> integrated;
  bool known_biases = false;  ///< they are the truth: nothing was estimated
  /// Motion, tracks that agree, and the gyroscope's bias. Where biases are known, or all tracks are right, what was not
  /// asked for is as it was given.
  RobustInitialisation found;
  std::optional<RefinementResult> refined;
  const ClosedFormResult& closedForm() const { return found.result; }
  ImuBias<double> bias() const;  ///< the best known
  std::optional<ViError> closed_form_error, refined_error;
  std::optional<double> gyroscope_error;  ///< rad/s, of the best known bias
  std::optional<double> nees;             ///< of the refined V and G, 5 degrees of freedom

  /// The refined states, or those of the closed form's first solution with its biases; empty: neither.
  std::vector<SE23d> states() const;
  /// Whether it has one answer that explains the data.
  bool ok() const;
  /// The status in a word: a name of FusionStatus, or why there is less.
  std::string status() const;
};

/// What disjoint windows say together (fusion/init/window_fusion.hpp), at the last image of the last.
struct ViFusion {
  double begin = 0, end = 0;  ///< s
  std::vector<std::size_t> windows;
  bool ok = false;
  double chi2 = 0;
  std::size_t degrees_of_freedom = 0;
  double p_value = 1;  ///< that windows which agree are so far apart
  /// In the body's axes: a unit vector, m/s, rad/s, m/s², with the RMS of the standard deviations of their coordinates.
  Eigen::Vector3d down, velocity, gyroscope_bias, accelerometer_bias;
  double down_deviation = 0, velocity_deviation = 0, gyroscope_deviation = 0, accelerometer_deviation = 0;
  /// Of the InertialState: direction of gravity (2, in the frame of its placement), velocity, gyroscope's bias, resting
  /// force (the accelerometer's bias less gravity).
  Eigen::Matrix<double, 11, 11> covariance = Eigen::Matrix<double, 11, 11>::Zero();
  std::optional<double> speed_error, gravity_error, gyroscope_error, accelerometer_error;  ///< m/s, rad, rad/s, m/s²
  std::optional<double> nees;                                                              ///< 11 degrees of freedom
};

struct ViInitResult {
  std::vector<ViWindow> windows;
  std::vector<ViFusion> fusions;
  double bearing_noise = 0;              ///< rad
  std::size_t images_outside = 0;        ///< that the readings do not cover
  std::size_t observations_outside = 0;  ///< pixels that the lens' model can't explain
};

/// Slides windows over a recording. progress(done, all) counts windows. Throws InputError where no window fits.
ViInitResult initialise(const ViRecording& recording, const ViInitOptions& options,
                        const std::function<void(std::uint64_t, std::uint64_t)>& progress);

}  // namespace liestat::cli
