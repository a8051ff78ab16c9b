// The definition of fusion/init/robust_initialisation.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/init/detail/second_motion.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/consensus.hpp>
#include <fusion/init/epipolar_gyroscope_bias.hpp>
#include <fusion/init/gyroscope_bias.hpp>
#include <fusion/init/refinement.hpp>
#include <fusion/init/robust_initialisation.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace liestat {

namespace detail {

/// A window that the closed form takes for one at rest: gravity and biases with the inertial sensor's noise, if that is
/// known, or a motion after all.
inline void refineRest(const InertialWindow& window, const InitialisationOptions& options,
                       RobustInitialisation& found) {
  if (found.result.status != FusionStatus::stationary || found.result.solutions.empty()) return;
  ClosedFormSolution& solution = found.result.solutions[0];
  const Eigen::Vector3d accelerometer = window.bias().accelerometer;
  RefinementResult rest =
      refineAtRest(window.without(found.outliers), solution.gravity, {found.gyroscope_bias, accelerometer}, options);
  if (rest.status == FusionStatus::stationary) {
    solution.gravity = rest.gravity;
    solution.accelerometer_bias = rest.bias.accelerometer - accelerometer;
    found.gyroscope_bias = rest.bias.gyroscope;
    found.bias_covariance = rest.covariance.of<InitialCovariance::gyroscope_bias>();
    found.result.tilt_sigma = rest.tilt_sigma;
    found.result.consistent = rest.prior_p >= 1e-4;
    found.rest = std::move(rest);
  } else if (rest.status != FusionStatus::bad_motion) {
    found.result.status = FusionStatus::no_parallax;
    found.result.solutions.clear();
    found.result.consistent = false;
    found.result.unseen_speed_per_depth = std::numeric_limits<double>::infinity();
  }
}

inline RobustInitialisation searchMotion(InertialWindow window, const InitialisationOptions& options) {
  RobustInitialisation found;
  const BiasPrior& prior = options.prior;
  found.epipolar = estimateEpipolarGyroscopeBias(window, options);
  found.integrations = found.epipolar.integrations;
  found.result.fault = found.epipolar.fault;
  if (found.result.fault) return found;
  found.gyroscope_bias = found.epipolar.bias;
  found.bias_covariance = found.epipolar.covariance;

  InitialisationOptions outer = options;
  // This keeps a short window from the wrong minimum of a large bias.
  if (found.epipolar.ok()) outer.gyroscope_bias.min_window = 0;
  const Eigen::Vector3d accelerometer = window.bias().accelerometer;
  const auto restoreCounts = [&] {
    for (const std::size_t i : found.outliers) found.result.features[i].observations = window.features[i].size();
  };
  found.status = FusionStatus::bias_from_rotations;
  std::uint64_t searches = 0;
  const auto consensusFor = [&](const Eigen::Vector3d& gyroscope) {
    const ImuBias<double> bias{gyroscope, accelerometer};
    found.integrations += window.integrateIfFar(bias);
    // Rounds draw anew.
    InitialisationOptions drawn = options;
    drawn.consensus.seed = CounterRng(options.consensus.seed, searches++)();
    ConsensusResult consensus = solveClosedFormRobustly(closedFormWindow(window, bias), drawn);
    found.hypotheses += consensus.hypotheses;
    return consensus;
  };
  for (; found.rounds < options.max_rounds; ++found.rounds) {
    ConsensusResult consensus = consensusFor(found.gyroscope_bias);
    const std::size_t tracks = consensus.inliers.size() + consensus.outliers.size();
    if (found.rounds == 0 && !found.epipolar.without_parallax) {
      // Rotations may have more than one explanation: the motion decides, if a good part of the tracks agree on it.
      std::vector<Eigen::Vector3d> others = found.epipolar.others;
      others.push_back(prior.mean.gyroscope);
      for (const Eigen::Vector3d& other : others) {
        if (2 * consensus.inliers.size() >= tracks) break;
        ConsensusResult next = consensusFor(other);
        if (5 * next.inliers.size() < 2 * tracks || next.inliers.size() <= consensus.inliers.size()) continue;
        consensus = std::move(next);
        found.gyroscope_bias = other;
        found.bias_covariance = prior.gyroscope_sigma * prior.gyroscope_sigma * Eigen::Matrix3d::Identity();
      }
    }
    const bool same = found.rounds > 0 && consensus.inliers == found.inliers;
    if (same && found.status == FusionStatus::ok) break;
    found.inliers = std::move(consensus.inliers);
    found.outliers = std::move(consensus.outliers);
    found.result = std::move(consensus.result);
    if (found.result.fault) {
      found.status = FusionStatus::bad_input;
      return found;
    }
    if (found.inliers.empty()) {
      found.status = FusionStatus::no_consensus;
      if (!found.epipolar.ok()) return found;
      // At rest and at constant velocity there is no motion to agree on, but still a rotation.
      found.status = FusionStatus::bias_from_rotations;
      found.inliers = found.epipolar.inliers;
      found.outliers = found.epipolar.outliers;
      found.result = solveClosedForm(
          closedFormWindow(window.without(found.outliers), {found.gyroscope_bias, accelerometer}), options);
      restoreCounts();
      return found;
    }
    outer.gyroscope_bias.start = found.gyroscope_bias;
    GyroscopeBiasResult estimate = estimateGyroscopeBias(window.without(found.outliers), outer);
    found.integrations += estimate.integrations;
    found.bias_status = estimate.status;
    if (estimate.status != FusionStatus::ok) {
      found.status = FusionStatus::bias_from_rotations;
      return found;
    }
    found.status = FusionStatus::ok;
    found.gyroscope_bias = estimate.bias;
    found.bias_covariance = estimate.covariance;
    found.result = std::move(estimate.result);
    restoreCounts();
  }
  return found;
}

}  // namespace detail

LIESTAT_FUSION_INLINE RobustInitialisation initialiseRobustly(const InertialWindow& window,
                                                              const InitialisationOptions& options) {
  RobustInitialisation found = detail::searchMotion(window, options);
  detail::refineRest(window, options, found);
  detail::addSecondMotion(window, {found.gyroscope_bias, window.bias().accelerometer}, options, found);
  return found;
}

}  // namespace liestat
