// How an estimate of fusion/ ended, in one enumeration for all of its estimators, and what was wrong with the input.
#pragma once

#include <cstddef>
#include <string>

namespace liestat {

/// How an estimate ended. With `ok` there is exactly one answer; whether it explains the data is the ok() of each
/// result. `ambiguous`, `double_root` and `mirror_gravity` come with all answers that there are; what another status
/// comes with is said where it is returned. (stats/ has its own, liestat::Status.)
enum class FusionStatus {
  ok,

  // The cases of a window (fusion/init/closed_form.hpp), those of docs/theory/visual_inertial.md, section 4.
  ambiguous,             ///< two solutions explain the data, or two groups of tracks each agree on one
  double_root,           ///< two solutions meet: noise is amplified without bound (acceleration across gravity)
  scale_unobservable,    ///< constant velocity: gravity and the direction of V known, lengths free
  stationary,            ///< at rest: V = 0 and gravity known, every depth free
  no_parallax,           ///< pure rotation, or features too far
  gravity_undetermined,  ///< the vertical is not determined, or |G| is unknown and the data do not give it
  bias_unobservable,     ///< the data do not tell the accelerometer's bias from gravity (no rotation)
  mirror_gravity,        ///< rotation about one axis: G and its mirror image, with biases that differ
  coplanar,              ///< few images, and features and positions in one plane
  too_few_images,        ///< more unknowns than equations for any motion

  // Obstacles of an iteration.
  bias_from_rotations,  ///< the motion does not tell the gyroscope's bias: it is that of rotations
  no_consensus,         ///< too few tracks agree
  no_start,             ///< no solution with features in front of the camera to start from
  window_too_short,     ///< too short for the gyroscope's bias without a prior as good as one from rest
  undetermined,         ///< the data and the priors do not determine all unknowns well enough
  bad_motion,           ///< a motion without a positive definite covariance (no noise was given), or not finite
  not_converged,        ///< the iterations ended before the estimate stayed

  // Obstacles to the use of a window of a recording (fusion/visual_inertial.hpp).
  gap,           ///< two readings are too far apart
  no_readings,   ///< the readings do not serve: see the window's fault
  no_features,   ///< none was seen in two of its images
  not_refined,   ///< the refinement did not succeed: see its status
  inconsistent,  ///< one answer, which does not explain the data

  bad_input  ///< the measurements or the options: see the result's fault
};

/// True if an estimation with this status found its answer, or all of several, whatever else can be said about it. The
/// function of the same name for liestat::Status means the same, and the harness of stats/validation.hpp takes both.
constexpr bool converged(FusionStatus status) {
  return status == FusionStatus::ok || status == FusionStatus::ambiguous || status == FusionStatus::double_root ||
         status == FusionStatus::mirror_gravity || status == FusionStatus::inconsistent;
}

/// Kinds of faults in the input.
enum class FaultKind {
  none,
  // A window.
  too_few_images,    ///< fewer than two
  image_not_finite,  ///< index: image
  image_order,       ///< index: the image that is not later than the one before, or does not start at 0
  not_a_rotation,    ///< index: image
  wrong_index,       ///< index: feature that names an image or a camera that does not exist
  bad_bearing,       ///< index: feature with a bearing of zero length or not finite, or a sigma that is not positive
  bearing_time,      ///< index: feature with a bearing that was not taken at the time of its image
  no_feature,        ///< none was seen twice
  bad_option,        ///< an option or a camera that is not usable
  // Readings of an inertial sensor.
  bad_interval,   ///< the end is not after the start
  not_covered,    ///< index: the reading nearest to where there are none
  not_ascending,  ///< index: the reading whose time is not later than the one before
  not_finite,     ///< index: the reading with a time, rate or force that is NaN or infinite
  gap,            ///< index: the reading that is too long after the one before
  // Pairs of poses.
  too_few_poses,    ///< index: how many there are
  pose_not_finite,  ///< index: pair
  // Points that an image shows.
  too_few_points,   ///< index: how many there are
  bad_point,        ///< index: point that is not finite, or seen where the camera sees nothing
  bad_pixel_noise,  ///< the covariance of pixels is not finite, of another size, or not positive definite
  bad_covariance  ///< index: pair with a covariance that is not finite, not symmetric or has a negative eigenvalue, or
                  ///< with two of less than rank six together
};

/// The first thing that is wrong with the input, and where; none where nothing is.
struct Fault {
  FaultKind kind = FaultKind::none;
  std::size_t index = 0;

  Fault() = default;
  Fault(FaultKind what, std::size_t where = 0) : kind(what), index(where) {}  // NOLINT: a kind is a fault
  /// True where there is one.
  explicit operator bool() const { return kind != FaultKind::none; }
  friend bool operator==(const Fault&, const Fault&) = default;
  /// True where it is of a kind, wherever.
  friend bool operator==(const Fault& fault, FaultKind of_kind) { return fault.kind == of_kind; }
};

/// The enumerator's name, for files.
inline const char* name(FusionStatus status) {
  switch (status) {
    case FusionStatus::ok:
      return "ok";
    case FusionStatus::ambiguous:
      return "ambiguous";
    case FusionStatus::double_root:
      return "double_root";
    case FusionStatus::scale_unobservable:
      return "scale_unobservable";
    case FusionStatus::stationary:
      return "stationary";
    case FusionStatus::no_parallax:
      return "no_parallax";
    case FusionStatus::gravity_undetermined:
      return "gravity_undetermined";
    case FusionStatus::bias_unobservable:
      return "bias_unobservable";
    case FusionStatus::mirror_gravity:
      return "mirror_gravity";
    case FusionStatus::coplanar:
      return "coplanar";
    case FusionStatus::too_few_images:
      return "too_few_images";
    case FusionStatus::bias_from_rotations:
      return "bias_from_rotations";
    case FusionStatus::no_consensus:
      return "no_consensus";
    case FusionStatus::no_start:
      return "no_start";
    case FusionStatus::window_too_short:
      return "window_too_short";
    case FusionStatus::undetermined:
      return "undetermined";
    case FusionStatus::bad_motion:
      return "bad_motion";
    case FusionStatus::not_converged:
      return "not_converged";
    case FusionStatus::gap:
      return "gap";
    case FusionStatus::no_readings:
      return "no_readings";
    case FusionStatus::no_features:
      return "no_features";
    case FusionStatus::not_refined:
      return "not_refined";
    case FusionStatus::inconsistent:
      return "inconsistent";
    case FusionStatus::bad_input:
      return "bad_input";
  }
  return "";
}

/// In words, for people.
inline const char* describe(FusionStatus status) {
  switch (status) {
    case FusionStatus::ok:
      return "one solution";
    case FusionStatus::ambiguous:
      return "two solutions explain the data";
    case FusionStatus::double_root:
      return "two solutions meet, noise is amplified: the acceleration is at a right angle to gravity";
    case FusionStatus::scale_unobservable:
      return "the scale is not observable: constant velocity; gravity is known";
    case FusionStatus::stationary:
      return "at rest: gravity is known, depths are not";
    case FusionStatus::no_parallax:
      return "no parallax: pure rotation, or features too far";
    case FusionStatus::gravity_undetermined:
      return "gravity is not determined";
    case FusionStatus::bias_unobservable:
      return "the accelerometer's bias can't be told from gravity: no rotation";
    case FusionStatus::mirror_gravity:
      return "gravity and its mirror image explain the data: rotation about one axis with an unknown bias";
    case FusionStatus::coplanar:
      return "features and positions lie in one plane: more images or features are needed";
    case FusionStatus::too_few_images:
      return "too few images for the unknowns";
    case FusionStatus::bias_from_rotations:
      return "the motion does not tell the gyroscope's bias: it is that of rotations";
    case FusionStatus::no_consensus:
      return "too few tracks agree";
    case FusionStatus::no_start:
      return "no solution with features in front of the camera to start from";
    case FusionStatus::window_too_short:
      return "the window is too short to estimate the gyroscope's bias without a prior from rest";
    case FusionStatus::undetermined:
      return "the data and the priors do not determine all unknowns";
    case FusionStatus::bad_motion:
      return "a motion has no positive definite covariance: was the sensor's noise given?";
    case FusionStatus::not_converged:
      return "the iterations ended before the estimate stayed";
    case FusionStatus::gap:
      return "two readings are too far apart";
    case FusionStatus::no_readings:
      return "the readings do not cover it, or are not usable";
    case FusionStatus::no_features:
      return "no feature was seen in two images";
    case FusionStatus::not_refined:
      return "the refinement did not succeed";
    case FusionStatus::inconsistent:
      return "the solution does not explain the data";
    case FusionStatus::bad_input:
      return "bad input";
  }
  return "";
}

/// The fault in words, with the index of the culprit, for people.
inline std::string describe(const Fault& fault) {
  const std::string at = std::to_string(fault.index);
  switch (fault.kind) {
    case FaultKind::none:
      return "no fault";
    case FaultKind::too_few_images:
      return "fewer than two images";
    case FaultKind::image_not_finite:
      return "image " + at + ": time, rotation or displacement is not finite";
    case FaultKind::image_order:
      return "image " + at + ": times must ascend from 0";
    case FaultKind::not_a_rotation:
      return "image " + at + ": the rotation is not a rotation matrix";
    case FaultKind::wrong_index:
      return "feature " + at + ": seen by an image or a camera that does not exist";
    case FaultKind::bad_bearing:
      return "feature " + at + ": a bearing is zero or not finite, or its sigma is not positive";
    case FaultKind::bearing_time:
      return "feature " + at + ": a bearing at another time than its image's is not supported";
    case FaultKind::no_feature:
      return "no feature was seen in two images";
    case FaultKind::bad_option:
      return "an option or a camera is out of range";
    case FaultKind::bad_interval:
      return "the end is not after the start";
    case FaultKind::not_covered:
      return "the readings do not reach from start to end";
    case FaultKind::not_ascending:
      return "reading " + at + ": its time is not later than the one before";
    case FaultKind::not_finite:
      return "reading " + at + ": not finite";
    case FaultKind::gap:
      return "reading " + at + ": too long after the one before";
    case FaultKind::too_few_poses:
      return at + " pairs of poses are too few";
    case FaultKind::pose_not_finite:
      return "pair " + at + ": a pose is not finite";
    case FaultKind::too_few_points:
      return at + " points are too few, four are needed";
    case FaultKind::bad_point:
      return "point " + at + ": not finite, or where the camera sees nothing";
    case FaultKind::bad_pixel_noise:
      return "the covariance of the pixels is not positive definite, or of another size";
    case FaultKind::bad_covariance:
      return "pair " + at +
             ": a covariance is not symmetric and positive semi-definite, or both together have less than rank 6";
  }
  return "";
}

}  // namespace liestat
