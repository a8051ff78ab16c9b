// The results of the steps of a visual-inertial initialisation, for units that only look at them: estimators cost a
// compiler more than the rest of the library. The closed form's results are in closed_form_types.hpp.
#pragma once

#include <stats/noise_fit.hpp>
#include <fusion/imu/readings.hpp>
#include <fusion/init/closed_form_types.hpp>
#include <fusion/status.hpp>
#include <lie/se23.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <vector>

namespace liestat {

// estimateEpipolarGyroscopeBias(), in epipolar_gyroscope_bias.hpp

/// Indices are the window's. Tracks that no pair of images in use has in common are in neither list.
struct EpipolarBiasResult {
  /// ok, undetermined (too few tracks, or hardly any parallax: the bias is the one that makes directions stay best),
  /// no_consensus, not_converged or bad_input (then see fault).
  FusionStatus status = FusionStatus::bad_input;
  Fault fault;
  /// Found by directions that stay: the body did not move, or features are far (then see covariance).
  bool without_parallax = false;

  Eigen::Vector3d bias = Eigen::Vector3d::Zero();  ///< rad/s, whole: not the change of the one that was integrated
  /// From the noise of the accepted tracks, of the gyroscope where the motions were integrated with it, and the prior;
  /// to first order. Pairs of images share bearings: it is not the inverse of the normal equations. Without parallax a
  /// parallax that is too small or too even to be seen is not in it: the bias is then off by speed over distance.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  std::vector<std::size_t> inliers, outliers;  ///< ascending; a drift along the epipolar lines is not seen
  std::vector<double> residuals;               ///< RMS of each track, in sigmas; infinite in neither list
  /// Other biases for which many tracks agree, the best first: what else to try where this one turns out to be wrong.
  std::vector<Eigen::Vector3d> others;
  std::size_t pairs_used = 0;  ///< pairs of images
  int starts = 0, iterations = 0;
  int integrations = 0;  ///< how often the readings were integrated anew

  /// True if the residuals of the accepted tracks are noise, by χ², and their features in front of the camera. If not:
  /// the minimum may be a wrong one, or there is more noise than was said.
  bool consistent = false;

  /// Exactly one answer, converged, that explains the data.
  bool ok() const { return status == FusionStatus::ok && consistent; }
};

// refine() and refineAtRest(), in refinement.hpp

/// The joint covariance of all that a refinement tells but what is between the first image and the last: 27 unknowns in
/// blocks of three. The last state's are its right tangent; gravity is in the axes of t0, and singular along itself
/// where its length is known. Position and heading of t0's frame are exact by definition. A bias that does not walk is
/// the same at both ends, and so are its two blocks.
struct InitialCovariance {
  /// The first row of each block.
  enum Block {
    first_velocity = 0,           ///< V, at t0 (m/s)
    last_position = 3,            ///< m
    last_rotation = 6,            ///< rad
    last_velocity = 9,            ///< m/s
    gravity = 12,                 ///< G (m/s²)
    gyroscope_bias = 15,          ///< at t0 (rad/s)
    accelerometer_bias = 18,      ///< at t0 (m/s²)
    last_gyroscope_bias = 21,     ///< at the last image
    last_accelerometer_bias = 24  ///< at the last image
  };
  Eigen::Matrix<double, 27, 27> joint = Eigen::Matrix<double, 27, 27>::Zero();

  Eigen::Matrix3d block(Block row, Block column) const { return joint.block<3, 3>(row, column); }
  /// The covariance of some blocks, in their order.
  template <Block... blocks>
  Eigen::Matrix<double, 3 * sizeof...(blocks), 3 * sizeof...(blocks)> of() const {
    constexpr int n = sizeof...(blocks);
    constexpr Block list[] = {blocks...};
    Eigen::Matrix<double, 3 * n, 3 * n> part;
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < n; ++j) part.template block<3, 3>(3 * i, 3 * j) = block(list[i], list[j]);
    }
    return part;
  }
  /// The covariance of (V, G, gyroscope's bias, accelerometer's bias) at t0.
  Eigen::Matrix<double, 12, 12> atFirst() const {
    return of<first_velocity, gravity, gyroscope_bias, accelerometer_bias>();
  }
  /// That of the last state (position, rotation, velocity), then G and both biases there: a filter starts from it.
  Eigen::Matrix<double, 18, 18> atLast() const {
    return of<last_position, last_rotation, last_velocity, gravity, last_gyroscope_bias, last_accelerometer_bias>();
  }
};

/// Everything is in the body's axes at the first image, t0.
struct RefinementResult {
  /// ok, not_converged, undetermined, no_start (the start has no feature in front of its cameras), bad_motion or
  /// bad_input (then see fault). gravity_undetermined or scale_unobservable: it converged, but on the vertical or on the
  /// scale the covariance says less than the options ask for (ClosedFormOptions::max_tilt_sigma, max_scale_sigma). Of
  /// refineAtRest(): stationary, or no_parallax where the readings are not those of a body at rest.
  FusionStatus status = FusionStatus::bad_input;
  Fault fault;

  std::vector<SE23d> states;  ///< at each image: orientation, position, velocity; the first at the identity and 0
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
  ImuBias<double> bias;                   ///< at t0; whole: not the change of the one that was integrated
  ImuBias<double> last_bias;              ///< at the last image; another where the sensor's noise has a walk
  std::vector<Eigen::Vector3d> features;  ///< NaN for a feature that was not used

  /// Covers the state from which a filter starts, and the velocity at t0.
  InitialCovariance covariance;

  /// Relative standard deviation of the scale: of the images' positions along themselves.
  double scale_sigma = std::numeric_limits<double>::infinity();
  double tilt_sigma = std::numeric_limits<double>::infinity();  ///< rad, of the vertical: about its least known axis
  /// The probability of biases as far from the prior's mean as these, if the prior is true: twice the smaller of both
  /// sensors'. What the data do not tell of a bias does not count.
  double prior_p = 1;

  double cost = 0;  ///< χ² of bearings, motions and priors
  std::size_t degrees_of_freedom = 0;
  std::size_t features_used = 0, observations_used = 0;
  int iterations = 0;
  int integrations = 0;           ///< how often the readings were integrated anew
  bool must_reintegrate = false;  ///< the biases have gone too far for a first-order update, and the window can't help

  Eigen::Vector3d velocity() const {
    return states.empty() ? Eigen::Vector3d::Zero() : Eigen::Vector3d(states[0].velocity());
  }
  /// True if the cost is one of noise, to five sigmas of χ², and the biases are those of the prior, p ≥ 1e-4. The cost
  /// alone, with its thousands of bearings, hardly sees a bias.
  bool consistent() const {
    return cost <= detail::noiseLimit(static_cast<double>(degrees_of_freedom)) && prior_p >= 1e-4;
  }
  /// True if there are states with their covariance, be it a large one.
  bool converged() const {
    return status == FusionStatus::ok || status == FusionStatus::gravity_undetermined ||
           status == FusionStatus::scale_unobservable || status == FusionStatus::stationary;
  }
  /// Exactly one answer, converged, that explains the data.
  bool ok() const { return status == FusionStatus::ok && consistent() && !must_reintegrate; }
};

// initialiseRobustly(), in robust_initialisation.hpp

/// Fused windows (window_fusion.hpp) that are as far apart with less than this probability contradict each other.
inline constexpr double min_p_of_fusion = refutation_level;
/// The former name of min_p_of_fusion.
[[deprecated("min_p_of_fusion")]] inline constexpr double least_p_of_fusion = min_p_of_fusion;

/// Tracks that do not agree with the first motion but with another, and what they say. Indices are the window's.
struct SecondMotion {
  ClosedFormResult result;           ///< with its covariance
  std::vector<std::size_t> inliers;  ///< ascending, none of the first's
};

/// Indices are the window's.
struct RobustInitialisation {
  /// ok: motion and bias were found together (whether the motion is determined: see result.status).
  /// bias_from_rotations: the motion does not tell the bias (at rest, constant velocity: see result.status and
  /// bias_status). The bias is that of rotations, as good as epipolar.status says; without a consensus on the motion so
  /// are the inliers.
  /// no_consensus: too few tracks agree, be it on a motion or on rotations; the result is that of all.
  /// ambiguous: two groups of tracks each agree on a motion, and nothing tells which of them is the world and which a
  /// body that moves: the larger is in result and inliers, the other in second.
  /// bad_input: see result.fault.
  FusionStatus status = FusionStatus::bad_input;
  Eigen::Vector3d gyroscope_bias = Eigen::Vector3d::Zero();  ///< rad/s, whole
  /// With status ok from image noise and the prior, else that of `epipolar`; the prior's where the bias is neither.
  Eigen::Matrix3d bias_covariance = Eigen::Matrix3d::Zero();
  ClosedFormResult result;                             ///< for this bias, of the inliers
  std::vector<std::size_t> inliers, outliers;          ///< ascending
  EpipolarBiasResult epipolar;                         ///< where it began
  std::optional<SecondMotion> second;                  ///< where status is ambiguous
  std::optional<RefinementResult> rest;                ///< where result.status is stationary and the noise is known
  FusionStatus bias_status = FusionStatus::bad_input;  ///< status of the last estimate with the motion
  std::size_t hypotheses = 0;
  int rounds = 0;
  int integrations = 0;  ///< how often the readings were integrated anew

  /// Exactly one answer, which explains the data of the inliers.
  bool ok() const { return status == FusionStatus::ok && result.ok(); }
};

}  // namespace liestat
