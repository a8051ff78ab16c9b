// The options of visual-inertial initialisation, of all its steps in one tree: noise, gravity and the priors of the
// biases are stated once, and each step adds the numbers that only it needs.
//
//   const liestat::InitialisationOptions options{.bearing_noise = 1. / 450, .closed_form = {.estimate_bias = true}};
//
// Every function of fusion/init/ takes the whole tree and reads its part.
#pragma once

#include <fusion/imu/readings.hpp>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace liestat {

/// The prior of the biases: normal about `mean`, with these standard deviations in each axis.
struct BiasPrior {
  ImuBias<double> mean = {};
  double gyroscope_sigma = 0.1;       ///< rad/s
  double accelerometer_sigma = 0.15;  ///< m/s²; for the closed form infinite means none
};

/// fusion/init/closed_form.hpp
struct ClosedFormOptions {
  /// Also the accelerometer's bias, as a correction of the one that was integrated, with a prior N(0, σ²) about that.
  bool estimate_bias = false;
  int weight_passes = 3;          ///< passes with weights 1/depth² after the first; exact data need none
  bool singular_values = true;    ///< the diagnosis of ranks; exact data always have it
  double min_parallax = 4;        ///< with noise: RMS parallax of a feature that is used, in sigmas of a bearing
  bool remove_noise_bias = true;  ///< with noise: take off what noise adds to the system. Without, scale is too small
  /// Limits to what counts as determined, with noise, in the refinement too: the scale to 30 %, the vertical to 0.2 rad.
  double max_scale_sigma = 0.3;
  double max_tilt_sigma = 0.2;
};

/// fusion/init/consensus.hpp
struct ConsensusOptions {
  double max_residual = 3;   ///< RMS angle of an inlier, in sigmas of a bearing
  double misfit_sigmas = 5;  ///< a feature whose χ² exceeds its mean by more sigmas is dropped from the final solution
  std::size_t features_drawn = 4;  ///< a hypothesis
  std::size_t max_hypotheses = 300;
  double confidence = 0.9999;    ///< drawing ends when an all-inlier sample was missed with 1 - this probability
  std::size_t local_passes = 3;  ///< times that inliers of the best hypothesis so far are solved for again
  std::uint64_t seed = 1;        ///< the same seed gives the same draws and result
};

/// fusion/init/robust_initialisation.hpp: a second motion, among the tracks that do not agree with the first. Tracks that
/// drift independently of each other agree on one by chance in less than one window of a hundred (docs/closed_form.md).
struct SecondMotionOptions {
  bool search = true;
  double min_part = 0.2;         ///< fraction of all tracks that must agree on it,
  std::size_t beyond_drawn = 3;  ///< and their least number beyond the sample of a hypothesis
};

/// fusion/init/epipolar_gyroscope_bias.hpp
struct EpipolarBiasOptions {
  /// RMS by which the directions of a pair of images must move, beyond what a rotation explains, in sigmas.
  double min_parallax = 4;
  double misfit_sigmas = 5;    ///< a track whose χ² exceeds its mean by more sigmas is rejected
  double min_consensus = 0.4;  ///< fraction of the tracks that must agree
  double max_sigma = 0.02;     ///< rad/s, predicted, of the bias's least known direction
  int max_iterations = 30;     ///< in the last stage
};

/// fusion/init/gyroscope_bias.hpp
struct GyroscopeBiasOptions {
  std::optional<Eigen::Vector3d> start = {};  ///< rad/s, where to begin; none: at the prior
  double max_step = 0.2;                      ///< rad/s
  /// A window of at most so many seconds is only solved with a prior as good as one from rest.
  double min_window = 1;
  double sigma_from_rest = 0.02;  ///< rad/s
  int max_rounds = 8;             ///< each from the closed form for the last one's bias
  int max_iterations = 20;        ///< in a round
};

/// fusion/init/refinement.hpp
struct RefinementOptions {
  int max_iterations = 50;     ///< 0: no estimate, but the covariance at the start
  double min_decrease = 1e-3;  ///< converged when the cost (χ²) decreases by less
  int max_integrations = 3;    ///< how often the readings are integrated anew for biases that have gone too far
};

/// All of them.
struct InitialisationOptions {
  /// Standard deviation of a bearing in each direction across it, in rad (pixel noise over focal length), times the
  /// bearing's own relative_sigma. 0: exact data, which only the closed form takes; its status is decided by ranks.
  double bearing_noise = 0;
  std::optional<double> gravity = 9.81;  ///< |G| in m/s²; none: its length is an unknown too
  BiasPrior prior = {};
  /// Scales the standard deviations of the preintegrated motions in the refinement: data sheets tell the noise of a
  /// sensor at rest, and on real recordings errors are larger (scale factors, vibration, time stamps).
  double inertial_noise_factor = 1;
  int max_rounds = 3;  ///< initialiseRobustly(): alternations of consensus and gyroscope's bias

  ClosedFormOptions closed_form = {};
  ConsensusOptions consensus = {};
  SecondMotionOptions second_motion = {};
  EpipolarBiasOptions epipolar = {};
  GyroscopeBiasOptions gyroscope_bias = {};
  RefinementOptions refinement = {};
};

/// The options for the refinement of each of n windows to be fused (fusion/init/window_fusion.hpp), so that all
/// together count the prior of the biases once: standard deviations √n times as large.
inline InitialisationOptions withSharedPrior(InitialisationOptions options, std::size_t n) {
  const double root = std::sqrt(static_cast<double>(n));
  options.prior.gyroscope_sigma *= root;
  options.prior.accelerometer_sigma *= root;
  return options;
}

}  // namespace liestat
