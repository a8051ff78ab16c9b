// What goes into the closed form of visual-inertial initialisation and what comes out (fusion/init/closed_form.hpp).
//
// The working frame is the body's at the first image, t0. All vectors are in it, unless a bearing: bearings are unit
// vectors in the body's axes at their image.
#pragma once

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace liestat {

template <class S>
class Preintegration;

/// What the inertial sensor says about one image: C_j and S_j of the paper (Martinelli 2012, section II).
struct WindowImage {
  double time = 0;                                                 ///< s since the first image
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();          ///< C_j: the body's axes in t0
  Eigen::Vector3d displacement = Eigen::Vector3d::Zero();          ///< S_j: twice integrated specific force (m)
  Eigen::Matrix3d displacement_by_bias = Eigen::Matrix3d::Zero();  ///< of S_j, by the accelerometer's bias
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
  Eigen::Vector3d bearing = Eigen::Vector3d::Zero();  ///< in the body's axes; of any length but zero
  /// Its standard deviation in units of the options' `bearing_noise`, the same in each direction across it. A pixel is
  /// a smaller angle off the axis of a camera, and detectors have scales.
  double deviation = 1;
};

/// All that was seen of a feature; in any order, not all images need to see it.
using FeatureTrack = std::vector<TrackedBearing>;

/// The measurements of one window.
struct ClosedFormWindow {
  std::vector<WindowImage> images;  ///< ascending in time, the first at 0 with C = I and S = 0
  std::vector<FeatureTrack> features;
  Eigen::Vector3d camera = Eigen::Vector3d::Zero();  ///< p_c: the camera's centre in the body (m)
};

struct ClosedFormOptions {
  std::optional<double> gravity = 9.81;  ///< |G| in m/s²; none: its length is an unknown too
  /// Standard deviation of a bearing in each direction across it, in rad (pixel noise over focal length), times the
  /// bearing's own `deviation`. 0: exact data, whose status is decided by ranks, whatever their deviations.
  double bearing_noise = 0;
  bool estimate_bias = false;     ///< also the accelerometer's bias, as a correction of the integrated one
  double bias_deviation = 0.1;    ///< m/s², of its prior N(0, s²); infinite: none
  int weight_passes = 3;          ///< passes with weights 1/depth² after the first; exact data need none
  bool singular_values = true;    ///< the diagnosis of ranks; exact data always have it
  double least_parallax = 4;      ///< with noise: RMS parallax of a feature that is used, in deviations of a bearing
  bool remove_noise_bias = true;  ///< with noise: take off what noise adds to the system. Without, scale is too small
  /// What counts as determined, with noise: the scale to 30 %, the vertical to 0.2 rad.
  double largest_scale_deviation = 0.3;
  double largest_tilt_deviation = 0.2;
};

/// What a window allows to say, one for each case of the design note's section 4. Only `ok` has one solution;
/// `ambiguous`, `double_root` and `mirror_gravity` come with all there are.
enum class ClosedFormStatus {
  ok,
  ambiguous,             ///< two solutions explain the data, both with the features in front of the camera
  double_root,           ///< two solutions meet: noise is amplified without bound (acceleration across gravity)
  scale_unobservable,    ///< constant velocity: gravity and the direction of V known, lengths free
  stationary,            ///< at rest: V = 0 and gravity known, every depth free
  no_parallax,           ///< pure rotation, or features too far
  gravity_undetermined,  ///< the vertical is not determined, or |G| is unknown and the data do not give it
  bias_unobservable,     ///< the data do not tell the bias from gravity (no rotation)
  mirror_gravity,        ///< rotation about one axis: G and its mirror image, with biases that differ
  coplanar,              ///< few images, and features and positions in one plane
  too_few_images,        ///< more unknowns than equations for any motion
  bad_input              ///< see fault
};

/// Why a window was not solved.
enum class ClosedFormFault {
  none,
  too_few_images,    ///< fewer than two
  image_not_finite,  ///< index: image
  image_order,       ///< index: the image that is not later than the one before, or does not start at 0
  not_a_rotation,    ///< index: image
  wrong_index,       ///< index: feature that names an image that does not exist
  bad_bearing,       ///< index: feature with a bearing of zero length or not finite, or a deviation not positive
  no_feature,        ///< none was seen twice
  bad_option         ///< gravity, noise, bias deviation or lever arm not usable
};

/// What happened to a feature.
struct ClosedFormFeature {
  std::size_t observations = 0;
  bool used = false;              ///< false: seen in fewer than two images
  bool depth_determined = false;  ///< false: no parallax; its position is then any point of its line in front
  double parallax = 0;            ///< rad, RMS of its directions about their mean after compensation of the rotation
  double residual = 0;            ///< rad, RMS over its observations; this and the parallax weighted by 1/deviation²
  double deviation = 1;           ///< of its bearings, relative: root of the harmonic mean of their squares
  double depth_deviation = std::numeric_limits<double>::infinity();  ///< m, along its first bearing; image noise only
};

/// One minimiser.
struct ClosedFormSolution {
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero();            ///< V: at the first image (m/s)
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();             ///< G (m/s²), downwards
  Eigen::Vector3d accelerometer_bias = Eigen::Vector3d::Zero();  ///< m/s², beyond the one that was integrated
  std::vector<Eigen::Vector3d> features;                         ///< P_i (m); NaN for a feature that was not used
  double cost = 0;  ///< Σ (angle/noise)², and (bias/deviation)²; exact data count with a noise of 1e-9 rad
  std::size_t negative_depths = 0;  ///< features behind the camera in one of their images

  /// Rotation about the body's x axis that levels it, world_R_body = Rz(yaw) Ry(pitch) Rx(roll) with z upwards (rad).
  double roll() const { return std::atan2(-gravity.y(), -gravity.z()); }
  double pitch() const { return std::atan2(gravity.x(), std::hypot(gravity.y(), gravity.z())); }
};

/// What a covariance accounts for.
enum class CovarianceContent {
  none,                   ///< there is none: exact data, or not all unknowns are determined
  image_noise,            ///< image noise only: not the inertial sensor's noise, nor unmodelled biases
  image_noise_bias_prior  ///< image noise and the prior of the accelerometer's bias
};

/// Never an unmarked wrong answer: solutions are there where the data determine them, see status.
struct ClosedFormResult {
  ClosedFormStatus status = ClosedFormStatus::bad_input;
  ClosedFormFault fault = ClosedFormFault::none;
  std::size_t fault_index = 0;

  /// Local minima, the one to prefer first: 0, 1 or 2. With scale_unobservable, V and P are scaled to a median distance
  /// of features of one.
  std::vector<ClosedFormSolution> solutions;
  std::vector<ClosedFormFeature> features;

  /// Of the whole scaled linear system (columns P_i, V T, G T²/2 and b T²/2; rows N'), before priors and weights: the
  /// dimension of its null space, its largest singular value, and those of its restriction to the motions with the
  /// features that fit each best, descending (6, or 9 with bias). −1 and empty without diagnosis.
  int null_dimension = -1;
  double largest_singular_value = 0;
  std::vector<double> singular_values;

  /// Of (V, G) or (V, G, b) of the first solution, 6 or 9 square; singular along G where |G| is known. Empty: none.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 9, 9> covariance;
  CovarianceContent covariance_content = CovarianceContent::none;
  double scale_deviation = std::numeric_limits<double>::infinity();  ///< relative, predicted; with noise
  double tilt_deviation = std::numeric_limits<double>::infinity();   ///< rad, of the vertical, predicted; with noise

  double noise_share = 0;       ///< of what is known of the motion's least known direction, 0 to 1; with noise
  double window = 0;            ///< s, from the first image to the last that was used
  std::size_t images_used = 0;  ///< images with an observation that was used
  std::size_t features_used = 0;
  std::size_t observations_used = 0;
  std::size_t degrees_of_freedom = 0;  ///< of the first solution's cost

  /// Whether the first solution's cost is one of noise, by χ². If not: outliers, an unmodelled bias, bearings noisier
  /// than was said.
  bool consistent = false;

  /// Exactly one answer, which explains the data.
  bool ok() const { return status == ClosedFormStatus::ok && consistent; }
};

/// The enumerator's name, for files.
inline const char* name(ClosedFormStatus status) {
  switch (status) {
    case ClosedFormStatus::ok:
      return "ok";
    case ClosedFormStatus::ambiguous:
      return "ambiguous";
    case ClosedFormStatus::double_root:
      return "double_root";
    case ClosedFormStatus::scale_unobservable:
      return "scale_unobservable";
    case ClosedFormStatus::stationary:
      return "stationary";
    case ClosedFormStatus::no_parallax:
      return "no_parallax";
    case ClosedFormStatus::gravity_undetermined:
      return "gravity_undetermined";
    case ClosedFormStatus::bias_unobservable:
      return "bias_unobservable";
    case ClosedFormStatus::mirror_gravity:
      return "mirror_gravity";
    case ClosedFormStatus::coplanar:
      return "coplanar";
    case ClosedFormStatus::too_few_images:
      return "too_few_images";
    case ClosedFormStatus::bad_input:
      return "bad_input";
  }
  return "";
}

/// In words, for people.
inline const char* describe(ClosedFormStatus status) {
  switch (status) {
    case ClosedFormStatus::ok:
      return "one solution";
    case ClosedFormStatus::ambiguous:
      return "two solutions explain the data";
    case ClosedFormStatus::double_root:
      return "two solutions meet, noise is amplified: the acceleration is at a right angle to gravity";
    case ClosedFormStatus::scale_unobservable:
      return "the scale is not observable: constant velocity; gravity is known";
    case ClosedFormStatus::stationary:
      return "at rest: gravity is known, depths are not";
    case ClosedFormStatus::no_parallax:
      return "no parallax: pure rotation, or features too far";
    case ClosedFormStatus::gravity_undetermined:
      return "gravity is not determined";
    case ClosedFormStatus::bias_unobservable:
      return "the accelerometer's bias can't be told from gravity: no rotation";
    case ClosedFormStatus::mirror_gravity:
      return "gravity and its mirror image explain the data: rotation about one axis with an unknown bias";
    case ClosedFormStatus::coplanar:
      return "features and positions lie in one plane: more images or features are needed";
    case ClosedFormStatus::too_few_images:
      return "too few images for the unknowns";
    case ClosedFormStatus::bad_input:
      return "bad input";
  }
  return "";
}

/// In words, for people.
inline const char* describe(CovarianceContent content) {
  switch (content) {
    case CovarianceContent::none:
      return "none";
    case CovarianceContent::image_noise:
      return "image noise only";
    case CovarianceContent::image_noise_bias_prior:
      return "image noise and the prior of the accelerometer's bias only";
  }
  return "";
}

/// What is wrong with the input, with the index of the culprit.
inline std::string describeFault(const ClosedFormResult& result) {
  const std::string at = std::to_string(result.fault_index);
  switch (result.fault) {
    case ClosedFormFault::none:
      return "no fault";
    case ClosedFormFault::too_few_images:
      return "fewer than two images";
    case ClosedFormFault::image_not_finite:
      return "image " + at + ": time, rotation or displacement is not finite";
    case ClosedFormFault::image_order:
      return "image " + at + ": times must ascend from 0";
    case ClosedFormFault::not_a_rotation:
      return "image " + at + ": the rotation is not a rotation matrix";
    case ClosedFormFault::wrong_index:
      return "feature " + at + ": seen by an image that does not exist";
    case ClosedFormFault::bad_bearing:
      return "feature " + at + ": a bearing is zero or not finite, or its deviation is not positive";
    case ClosedFormFault::no_feature:
      return "no feature was seen in two images";
    case ClosedFormFault::bad_option:
      return "an option is out of range: gravity, noise, bias deviation or lever arm";
  }
  return "";
}

}  // namespace liestat
