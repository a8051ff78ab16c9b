// Recursive motion from point tracks: what goes into the filters of fusion/motion/ and what comes out of them.
//
//   liestat::SubspaceFilter filter({.flow = liestat::Flow::midpoint});
//   for (…) {
//     const liestat::MotionEstimate& motion = filter.update(pairs);       // or update(pairs, gyroscope)
//     if (motion.ok()) … motion.direction, motion.rotation, filter.inverse_depths() …
//   }
//
// Coordinates are calibrated: an image point (x, y) is the ray (x, y, 1) in the camera's axes (x right, y down, z
// forward), (u - c)/f of a pixel without distortion. A motion is that of the *points* as the camera sees them,
// X₂ = R X₁ + T between two frames, dX/dt = Ω × X + V within them; the camera itself moves against V. One frame is the
// unit of time: rotations are rad per frame.
//
// Source: S. Soatto and P. Perona, "Robust and efficient recovery of rigid motion from subspace constraints solved using
// recursive identification of nonlinear implicit systems", CIT-CDS 94-005, 1994.
#pragma once

#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/so3.hpp>
#include <stats/gaussian.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace liestat {

/// A point that was seen in two frames, the second `frames` frames after the first.
struct PointPair {
  Eigen::Vector2d first = Eigen::Vector2d::Zero(), second = Eigen::Vector2d::Zero();  ///< calibrated coordinates
  double sigma = 0;  ///< standard deviation of each coordinate in both frames (pixels over the focal length), > 0
  /// Frames between the two, > 0. A longer interval has the same noise and a larger motion: V and Ω, both per frame,
  /// are those of the middle of the interval. (Flow::discrete and the essential filter count it as one step: give all
  /// pairs the same, or let MotionFilter make them, which gives motions per frame.)
  double frames = 1;
};

/// How two positions of a point become its flow (the report's forward difference, and two that are more accurate).
enum class Flow {
  forward,   ///< x = y₁, ẋ = y₂ - y₁: the report's; a bias of first order in the rotation
  midpoint,  ///< x = (y₁ + y₂)/2, ẋ = y₂ - y₁: second order; position and flow have uncorrelated errors
  discrete   ///< y₁ is turned by the rotation first: the epipolar constraint itself, exact
};

/// The vector whose direction it is, and in which axes.
enum class DirectionMeaning {
  velocity,  ///< V: Flow::forward in the camera's axes at the first frame, Flow::midpoint in those half-way
  /// T of X₂ = R X₁ + T over the interval of the pairs, in the axes at its end (Flow::discrete, essential filter).
  translation
};

/// The rotation from a gyroscope over the interval of the pairs, in the sign and the axes of the filters: the apparent
/// rotation vector of the points, -R_camera_imu ∫ω dt (fusion/motion/gyroscope.hpp makes it of readings).
struct GyroscopeRotation {
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();        ///< rad per frame
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< rad², positive definite
};

/// Flags of one frame, besides the estimate. The state is kept through all of these.
struct MotionFlags {
  bool bad_input =
      false;             ///< pairs with NaN, or with a sigma that is not positive, were left out; or the gyroscope was
  bool too_few = false;  ///< fewer usable pairs than `min_pairs`: the frame was only predicted
  bool standstill = false;      ///< a rotation alone explains the flow: the frame says nothing of the direction
  bool degenerate = false;      ///< the direction is hardly determined: a standard deviation above `degenerate_sigma`
  bool ambiguous = false;       ///< another direction explains the frames nearly as well
  bool undecided_sign = false;  ///< the depths do not tell V from -V, or too many points would be behind the camera
  bool lost =
      false;  ///< the normalised innovation was above its bound over `lost_frames` frames; hypotheses start anew
  /// The frames' χ² refutes the motion at the stated noise: wrong pairs, a second object, a larger sigma, or a motion
  /// that changes faster than the filter follows.
  bool misfit = false;
  bool gyroscope_refuted = false;  ///< the rotation of the images contradicts the gyroscope's, in size or in the mean
  bool outliers = false;  ///< pairs were left out as outliers; the covariance is then not claimed to be an upper bound
};

/// The motion after one frame.
struct MotionEstimate {
  /// The direction of V or T, |V| = 1, with its covariance (rad²) in the local frame of S2. Successive flows share a
  /// frame, so that their errors are correlated: while points stay in view the covariance is an upper bound.
  Gaussian<S2d> direction;
  DirectionMeaning meaning = DirectionMeaning::velocity;
  /// second_R_first over one frame, with its covariance (rad²) in the local frame, R·Exp(v): along the first frame's
  /// axes. The rotation vector rotation.mean.log() is Ω.
  Gaussian<SO3d> rotation;
  Gaussian<Eigen::Vector3d> gyroscope_bias;  ///< rad per frame, signed like GyroscopeRotation; where it is a state

  /// |V|/Z, weighted by information over the points and discounted over some twenty frames; its sign is that of the
  /// depths.
  double mean_inverse_depth = 0, mean_inverse_depth_variance = 0;
  /// Evidence for positive depths, discounted over time, in its standard deviations: above 2 the sign is decided.
  double sign_evidence = 0;

  double signal = 0;  ///< χ² of the frame for a rotation alone over its degrees of freedom, 2N - 3: 1 at standstill
  double innovation = 0;  ///< cost of the frame before the update over its degrees of freedom: 1 expected
  double cost = 0;        ///< that cost
  int degrees_of_freedom = 0;
  std::size_t pairs = 0;                                       ///< usable ones
  std::size_t inliers = 0;                                     ///< those that the update used
  std::size_t hypotheses = 0;                                  ///< still alive
  double rival_gap = std::numeric_limits<double>::infinity();  ///< cost of the second best hypothesis minus the best's
  std::size_t frame = 0;                                       ///< updates since the start, this one included
  MotionFlags flags;

  /// Mean distance over |V|: 1/mean_inverse_depth, and its standard deviation to first order.
  double mean_distance() const { return 1 / mean_inverse_depth; }
  double mean_distance_sigma() const {
    using std::sqrt;
    return sqrt(mean_inverse_depth_variance) / (mean_inverse_depth * mean_inverse_depth);
  }
  /// True if the direction may be used without a further look.
  bool ok() const {
    return frame > 0 && !flags.standstill && !flags.degenerate && !flags.ambiguous && !flags.undecided_sign &&
           !flags.lost && !flags.misfit && !flags.gyroscope_refuted;
  }
  /// True if the covariance claims to bound the error.
  bool covariance_judged() const { return ok() && !flags.outliers; }
};

/// The inverse depth of one pair's point, in units of the motion of one frame.
struct InverseDepth {
  double value = 0;     ///< |V|/Z at the middle of the interval
  double variance = 0;  ///< variance from one frame, the direction given
  bool inlier = false;  ///< true if the update used the pair
};

/// A point of the structure (fusion/motion/structure.hpp).
struct StructurePoint {
  std::uint64_t track = 0;
  Eigen::Vector2d at = Eigen::Vector2d::Zero();  ///< in the image, at the middle of the last interval
  double inverse_depth = 0;                      ///< |V|/Z; its sign is that of the direction's
  double variance = 0;
  std::size_t frames = 0;  ///< that it is made of

  Eigen::Vector3d position() const { return at.homogeneous() / inverse_depth; }
};

/// The rigid one of two interpretations of the same points.
struct RigidityComparison {
  std::size_t distances = 0;  ///< that were compared, no point in two of them
  std::size_t steadier = 0;   ///< those that vary less in the first interpretation
  /// The probability that distances vary so much less in the first one if neither is more rigid than the other; 1 where
  /// nothing could be compared.
  double p_value = 1;

  /// The first interpretation is the rigid one, at this false-alarm probability (which takes seven distances).
  bool first_is_rigid(double level = 0.01) const { return p_value < level; }
};

/// One direction that competes, for pictures of the way of a filter.
struct MotionHypothesis {
  S2d direction;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< local frame, rad²
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();        ///< Ω of the last frame, rad per frame
  double score = 0;                                          ///< sum of the frames' costs
  /// The start that it came from, in the order of hemisphereLattice(starts); 0 of a start that was given, or linear.
  std::size_t start = 0;
};

/// Options of the filters. The values are those of the validation (docs/motion.md).
struct MotionFilterOptions {
  Flow flow = Flow::midpoint;  ///< with a gyroscope Flow::discrete is as accurate at any rotation
  std::size_t starts = 32;     ///< directions of a hemisphere to start from (rad² one each)
  /// rad² per frame of the direction, at least. A direction that wanders further than its covariances say gets more, up
  /// to `max_process_noise`, until it rests again; not with `outliers`.
  double process_noise = 1e-5;
  double max_process_noise = 1e-2;
  double rotation_noise = 1e-6;  ///< rad² per frame of the rotation, where it is a state (essential filter)

  // Hypotheses.
  std::size_t first_pruning = 6;  ///< frames before any hypothesis is dropped
  double prune_gap = 40;          ///< hypotheses whose score is so much above the best are dropped
  double merge_angle = 0.0524;    ///< rad; of hypotheses so near to a better one, up to sign, too
  double ambiguous_gap = 10;      ///< a rival whose score is within this makes the estimate ambiguous
  /// Neither happens, or the latter does, for a gap within so many standard deviations of the difference of two scores.
  double rival_sigmas = 2.5;
  double max_step = 0.5;  ///< rad per update

  // Sign of the direction.
  bool positive_depth = true;    ///< false: V and -V are both accepted, and half of the starts end at the antipode
  double evidence_decay = 0.95;  ///< per frame
  double min_sign_evidence = 2;  ///< below it the sign is undecided

  // Outliers.
  bool outliers = false;           ///< expect some: robust rotation per hypothesis, capped score, gates
  double outlier_threshold = 3.5;  ///< normalised error beyond which a pair is left out while hypotheses compete
  double gate = 3;                 ///< the same by the predicted error, once one hypothesis is left

  // Verdicts on a frame.
  std::size_t min_pairs = 8, min_pairs_gyroscope = 2;
  double standstill_probability = 0.04;  ///< probability of missing a standstill; see MotionFlags
  double degenerate_sigma = 0.2;         ///< rad, the larger standard deviation of the direction
  std::size_t lost_frames = 10;
  double lost_innovation = 2;  ///< mean normalised innovation of these frames above which hypotheses start anew

  // Gyroscope.
  bool estimate_bias = false;  ///< its bias is a state (of all filters)
  double bias_sigma = 2e-3;    ///< rad per frame, at the start
  double bias_noise = 0;       ///< rad² per frame
  /// With a gyroscope and `min_pairs` pairs: one hypothesis, from a linear solution over `linear_frames` frames. (Fewer
  /// pairs have more minima than one.)
  bool linear_start = true;
  std::size_t linear_frames = 6;

  /// False: the covariance of plain Gauss-Newton, which counts noise as signal; for comparisons.
  bool second_derivatives = true;
};

}  // namespace liestat
