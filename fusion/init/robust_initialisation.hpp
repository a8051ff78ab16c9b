// The whole initialisation of a window of which nothing is known: many tracks may be wrong, and the gyroscope's bias is
// anything up to 0.2 rad/s.
//
//   std::mt19937_64 generator(1);
//   const auto found = liestat::initialiseRobustly(
//       window, generator, {.ransac = {.closed_form = {.bearing_noise = 1. / 450}}}, integrate);
//   if (found.ok()) … found.gyroscope_bias, found.result.solutions[0], found.inliers; then refine()
//
// First the gyroscope's bias from rotations alone (epipolar_gyroscope_bias.hpp), which needs no motion and bears wrong
// tracks; for it, and for others that came near where few agree, the consensus on the motion (closed_form_ransac.hpp);
// on the tracks that agree the bias and the motion together (gyroscope_bias.hpp), and again while tracks come or go.
#pragma once

#include <fusion/init/consensus.hpp>
#include <fusion/init/epipolar_gyroscope_bias.hpp>
#include <fusion/init/gyroscope_bias.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <random>
#include <utility>
#include <vector>

namespace liestat {

struct RobustInitialisationOptions {
  RansacOptions ransac = {};                        ///< closed_form.bearing_noise must be given
  Eigen::Vector3d prior = Eigen::Vector3d::Zero();  ///< rad/s, of the gyroscope's bias
  double prior_deviation = 0.1;                     ///< rad/s
  int most_rounds = 3;                              ///< of consensus and bias
};

enum class RobustInitialisationStatus {
  ok,  ///< motion and bias were found together; whether the motion is determined: see result.status
  /// The motion does not tell the bias (at rest, constant velocity: see result.status and bias_status). The bias is
  /// that of rotations, as good as epipolar.status says; without a consensus on the motion so are the inliers.
  bias_from_rotations,
  no_consensus,  ///< too few tracks agree, be it on a motion or on rotations; the result is that of all
  bad_input      ///< see result.fault
};

/// In words, for people.
inline const char* describe(RobustInitialisationStatus status) {
  switch (status) {
    case RobustInitialisationStatus::ok:
      return "motion and gyroscope's bias were found";
    case RobustInitialisationStatus::bias_from_rotations:
      return "the motion does not tell the gyroscope's bias: it is that of rotations";
    case RobustInitialisationStatus::no_consensus:
      return "too few tracks agree on a motion";
    case RobustInitialisationStatus::bad_input:
      return "bad input";
  }
  return "";
}

/// Indices are the window's.
struct RobustInitialisation {
  RobustInitialisationStatus status = RobustInitialisationStatus::bad_input;
  Eigen::Vector3d gyroscope_bias = Eigen::Vector3d::Zero();  ///< rad/s, whole
  /// With status ok from image noise and the prior, else that of `epipolar`; the prior's where the bias is neither.
  Eigen::Matrix3d bias_covariance = Eigen::Matrix3d::Zero();
  ClosedFormResult result;                                           ///< for this bias, of the inliers
  std::vector<std::size_t> inliers, outliers;                        ///< ascending
  EpipolarBiasResult epipolar;                                       ///< where it began
  GyroscopeBiasStatus bias_status = GyroscopeBiasStatus::bad_input;  ///< of the last estimate with the motion
  std::size_t hypotheses = 0;
  int rounds = 0;
  int integrations = 0;  ///< how often the readings were integrated anew

  /// Exactly one answer, which explains the data of the inliers.
  bool ok() const { return status == RobustInitialisationStatus::ok && result.ok(); }
};

/// Velocity, gravity, features and the gyroscope's bias of a window. `integrate(bias)` integrates its readings anew: it
/// returns motions as in InertialWindow. The generator decides which features are drawn. Bad input: see result.fault.
template <std::uniform_random_bit_generator Generator, class Integrate>
RobustInitialisation initialiseRobustly(InertialWindow window, Generator& generator,
                                        const RobustInitialisationOptions& options, const Integrate& integrate) {
  RobustInitialisation found;
  const ClosedFormOptions& closed_form = options.ransac.closed_form;
  const auto counted = [&](const ImuBias<double>& bias) {
    ++found.integrations;
    return integrate(bias);
  };
  EpipolarBiasOptions epipolar;
  epipolar.bearing_noise = closed_form.bearing_noise;
  epipolar.prior = options.prior;
  epipolar.prior_deviation = options.prior_deviation;
  found.epipolar = estimateEpipolarGyroscopeBias(window, epipolar, counted);
  found.result.fault = found.epipolar.fault;
  found.result.fault_index = found.epipolar.fault_index;
  if (found.result.fault != ClosedFormFault::none) return found;
  found.gyroscope_bias = found.epipolar.bias;
  found.bias_covariance = found.epipolar.covariance;

  GyroscopeBiasOptions outer;
  outer.closed_form = closed_form;
  outer.prior = options.prior;
  outer.prior_deviation = options.prior_deviation;
  // What keeps a short window from the wrong minimum of a large bias.
  if (found.epipolar.ok()) outer.least_window = 0;
  const Eigen::Vector3d accelerometer = window.motions[0].options().bias.accelerometer;
  // A feature without observations keeps its place.
  const auto without = [](InertialWindow kept, const std::vector<std::size_t>& features) {
    for (const std::size_t i : features) kept.features[i].clear();
    return kept;
  };
  const auto restoreCounts = [&] {
    for (const std::size_t i : found.outliers) found.result.features[i].observations = window.features[i].size();
  };
  found.status = RobustInitialisationStatus::bias_from_rotations;
  const auto consensusFor = [&](const Eigen::Vector3d& gyroscope) {
    const ImuBias<double> bias{gyroscope, accelerometer};
    const auto far = [&](const Preintegration<double>& motion) { return motion.mustReintegrate(bias); };
    if (std::any_of(window.motions.begin(), window.motions.end(), far)) {
      std::vector<Preintegration<double>> motions = counted(bias);
      if (motions.size() == window.motions.size()) window.motions = std::move(motions);
    }
    ClosedFormRansacResult consensus =
        solveClosedFormRobustly(closedFormWindow(window, bias), generator, options.ransac);
    found.hypotheses += consensus.hypotheses;
    return consensus;
  };
  for (; found.rounds < options.most_rounds; ++found.rounds) {
    ClosedFormRansacResult consensus = consensusFor(found.gyroscope_bias);
    const std::size_t tracks = consensus.inliers.size() + consensus.outliers.size();
    if (found.rounds == 0 && found.epipolar.status != EpipolarBiasStatus::no_parallax) {
      // Rotations may have more than one explanation: the motion decides, if a good part of the tracks agree on it.
      std::vector<Eigen::Vector3d> others = found.epipolar.others;
      others.push_back(options.prior);
      for (const Eigen::Vector3d& other : others) {
        if (2 * consensus.inliers.size() >= tracks) break;
        ClosedFormRansacResult next = consensusFor(other);
        if (5 * next.inliers.size() < 2 * tracks || next.inliers.size() <= consensus.inliers.size()) continue;
        consensus = std::move(next);
        found.gyroscope_bias = other;
        found.bias_covariance = options.prior_deviation * options.prior_deviation * Eigen::Matrix3d::Identity();
      }
    }
    const bool same = found.rounds > 0 && consensus.inliers == found.inliers;
    if (same && found.status == RobustInitialisationStatus::ok) break;
    found.inliers = std::move(consensus.inliers);
    found.outliers = std::move(consensus.outliers);
    found.result = std::move(consensus.result);
    if (found.result.fault != ClosedFormFault::none) {
      found.status = RobustInitialisationStatus::bad_input;
      return found;
    }
    if (found.inliers.empty()) {
      found.status = RobustInitialisationStatus::no_consensus;
      if (!found.epipolar.ok()) return found;
      // At rest and at constant velocity there is no motion to agree on, but still a rotation.
      found.status = RobustInitialisationStatus::bias_from_rotations;
      found.inliers = found.epipolar.inliers;
      found.outliers = found.epipolar.outliers;
      found.result = solveClosedForm(
          closedFormWindow(without(window, found.outliers), {found.gyroscope_bias, accelerometer}), closed_form);
      restoreCounts();
      return found;
    }
    outer.start = found.gyroscope_bias;
    GyroscopeBiasResult estimate = estimateGyroscopeBias(without(window, found.outliers), outer, counted);
    found.bias_status = estimate.status;
    if (estimate.status != GyroscopeBiasStatus::ok) {
      found.status = RobustInitialisationStatus::bias_from_rotations;
      return found;
    }
    found.status = RobustInitialisationStatus::ok;
    found.gyroscope_bias = estimate.bias;
    found.bias_covariance = estimate.covariance;
    found.result = std::move(estimate.result);
    restoreCounts();
  }
  return found;
}

/// The same without readings: motions are updated to first order, whatever the change.
template <std::uniform_random_bit_generator Generator>
RobustInitialisation initialiseRobustly(const InertialWindow& window, Generator& generator,
                                        const RobustInitialisationOptions& options) {
  return initialiseRobustly(window, generator, options,
                            [](const ImuBias<double>&) { return std::vector<Preintegration<double>>(); });
}

}  // namespace liestat
