// The input and the result of the closed form of visual-inertial initialisation (fusion/init/closed_form.hpp).
//
// The working frame is the body's at the first image, t0. All vectors are in it but bearings, which are in the axes of
// their camera at their image.
#pragma once

#include <fusion/init/options.hpp>
#include <fusion/status.hpp>
#include <lie/se3.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

namespace liestat {

template <class S>
class Preintegration;

/// One image as the inertial sensor sees it: C_j and S_j of the paper (Martinelli 2012, section II).
struct WindowImage {
  double time = 0;                                                 ///< s since the first image
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();          ///< C_j: the body's axes in t0
  Eigen::Vector3d displacement = Eigen::Vector3d::Zero();          ///< S_j: twice integrated specific force (m)
  Eigen::Matrix3d displacement_by_bias = Eigen::Matrix3d::Zero();  ///< ∂S_j/∂b of the accelerometer's bias
};

/// The image at the end of a motion that was integrated from the first image on (fusion/imu/preintegration.hpp).
template <class S>
WindowImage windowImage(const Preintegration<S>& from_first) {
  const Eigen::Matrix3d rotation = from_first.increment().so3().matrix();
  // The Jacobian is in the library's right tangent, in the axes of the end.
  const Eigen::Matrix3d by_bias = from_first.biasJacobian().template block<3, 3>(0, 3);
  return {from_first.duration(), rotation, Eigen::Vector3d(from_first.increment().translation()), rotation * by_bias};
}

/// A feature as one image saw it.
struct TrackedBearing {
  std::size_t image = 0;                              ///< index into the window's images
  Eigen::Vector3d bearing = Eigen::Vector3d::Zero();  ///< in the axes of its camera; of any length but zero
  /// Its standard deviation in units of the options' `bearing_noise`, the same in each direction across it. A pixel is
  /// a smaller angle off the axis of a camera, and detectors have scales.
  double relative_sigma = 1;
  std::size_t camera = 0;           ///< index into the window's cameras
  std::optional<double> time = {};  ///< s since the first image; none: that of its image, as it must be to 1 µs so far
};

/// All that was seen of a feature; in any order, not all images need to see it.
using FeatureTrack = std::vector<TrackedBearing>;

/// The measurements of one window.
struct ClosedFormWindow {
  std::vector<WindowImage> images;  ///< ascending in time, the first at 0 with C = I and S = 0
  std::vector<FeatureTrack> features;
  std::vector<SE3d> cameras = {SE3d()};  ///< body_T_camera of each camera (m): its translation is p_c of the paper
};

/// How a feature was used and how well it is known.
struct ClosedFormFeature {
  std::size_t observations = 0;
  bool used = false;              ///< false: seen in fewer than two images
  bool depth_determined = false;  ///< false: no parallax; its position is then any point of its line in front
  double parallax = 0;            ///< rad, RMS of its directions about their mean after compensation of the rotation
  double residual = 0;        ///< rad, RMS over its observations; this and the parallax weighted by 1/relative_sigma²
  double relative_sigma = 1;  ///< root of the harmonic mean of its bearings' squared relative sigmas
  double depth_sigma = std::numeric_limits<double>::infinity();  ///< m, along its first bearing; image noise only
};

/// One minimiser.
struct ClosedFormSolution {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();            ///< V: at the first image (m/s)
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();             ///< G (m/s²), downwards
  Eigen::Vector3d accelerometer_bias = Eigen::Vector3d::Zero();  ///< m/s², beyond the one that was integrated
  std::vector<Eigen::Vector3d> features;                         ///< P_i (m); NaN for a feature that was not used
  double cost = 0;                  ///< Σ (angle/noise)², and (bias/σ)²; exact data count with a noise of 1e-9 rad
  std::size_t negative_depths = 0;  ///< features behind the camera in one of their images

  /// Rotation about the body's x axis that levels it, world_R_body = Rz(yaw) Ry(pitch) Rx(roll) with z upwards (rad).
  double roll() const { return std::atan2(-gravity.y(), -gravity.z()); }
  double pitch() const { return std::atan2(gravity.x(), std::hypot(gravity.y(), gravity.z())); }
};

/// The sources of error that a covariance accounts for.
enum class ClosedFormCovarianceContent {
  none,                   ///< there is none: exact data, or not all unknowns are determined
  image_noise,            ///< image noise only: not the inertial sensor's noise, nor unmodelled biases
  image_noise_bias_prior  ///< image noise and the prior of the accelerometer's bias
};

namespace detail {

/// The largest χ² that counts as noise: five standard deviations above the mean, and 12 more because χ² is skewed where
/// the degrees of freedom are few. Noise exceeds it with a probability below 1e-5, whatever their number.
inline double noiseLimit(double degrees_of_freedom) {
  return degrees_of_freedom + 5 * std::sqrt(2 * degrees_of_freedom) + 12;
}

}  // namespace detail

/// Never an unmarked wrong answer: solutions are there where the data determine them, see status.
struct ClosedFormResult {
  FusionStatus status = FusionStatus::bad_input;
  Fault fault;

  /// Local minima, the one to prefer first: 0, 1 or 2. With scale_unobservable, V and P are scaled to a median distance
  /// of features of one.
  std::vector<ClosedFormSolution> solutions;
  std::vector<ClosedFormFeature> features;

  /// For the whole scaled linear system (columns P_i, V T, G T²/2 and b T²/2; rows N'), before priors and weights: the
  /// dimension of its null space, its largest singular value, and those of its restriction to the motions with the
  /// features that fit each best, descending (6, or 9 with bias). −1 and empty without diagnosis.
  int null_dimension = -1;
  double largest_singular_value = 0;
  std::vector<double> singular_values;

  /// That of (V, G) or (V, G, b) of the first solution, 6 or 9 square; singular along a known |G|. Empty: none.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 9, 9> covariance;
  ClosedFormCovarianceContent covariance_content = ClosedFormCovarianceContent::none;
  double scale_sigma = std::numeric_limits<double>::infinity();  ///< relative, predicted; with noise
  double tilt_sigma = std::numeric_limits<double>::infinity();   ///< rad, of the vertical, predicted; with noise

  /// Fraction of the information on the motion's least known direction that is noise, 0 to 1; with noise.
  double noise_share = 0;
  double window = 0;            ///< s, from the first image to the last that was used
  std::size_t images_used = 0;  ///< images with an observation that was used
  std::size_t features_used = 0;
  std::size_t observations_used = 0;
  std::size_t degrees_of_freedom = 0;  ///< degrees of freedom of the first solution's cost

  /// With stationary and noise: a uniform motion of more than so many m/s for each metre to the features, which would
  /// have shown in the tracks, is excluded (with a probability of 0.995); infinite: nothing is.
  double unseen_speed_per_depth = std::numeric_limits<double>::infinity();

  /// True if the first solution's cost is one of noise, by χ². If not: outliers, an unmodelled bias, bearings noisier
  /// than was said.
  bool consistent = false;

  /// True if there is a solution with a scale, from which an iteration may start.
  bool hasMotion() const {
    return !solutions.empty() && status != FusionStatus::stationary && status != FusionStatus::scale_unobservable;
  }
  /// Exactly one answer, which explains the data.
  bool ok() const { return status == FusionStatus::ok && consistent; }
};

/// In words, for people.
inline const char* describe(ClosedFormCovarianceContent content) {
  switch (content) {
    case ClosedFormCovarianceContent::none:
      return "none";
    case ClosedFormCovarianceContent::image_noise:
      return "image noise only";
    case ClosedFormCovarianceContent::image_noise_bias_prior:
      return "image noise and the prior of the accelerometer's bias only";
  }
  return "";
}

}  // namespace liestat
