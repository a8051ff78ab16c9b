// The definition of fusion/init/refinement.hpp.
#pragma once

#include <fusion/init/detail/closed_form_input.hpp>
#include <fusion/init/detail/closed_form_uncertainty.hpp>
#include <fusion/detail/compiled.hpp>
#include <fusion/init/detail/refinement_problem.hpp>
#include <fusion/init/refinement.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/detail/small_products.hpp>
#include <stats/detail/tail_probabilities.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat {

namespace detail {

/// The covariance of the blocks of InitialCovariance, of a factored system.
inline Eigen::Matrix<double, 27, 27> jointCovariance(const RefinementProblem& problem, const ReducedSystem& system) {
  const std::size_t end = problem.state().X.size() - 1;
  std::vector<int> blocks{problem.stateBlock(0, 2),    problem.stateBlock(end, 0), problem.stateBlock(end, 1),
                          problem.stateBlock(end, 2),  problem.gravityBlock(),     problem.gyroscopeBlock(),
                          problem.accelerometerBlock()};
  // A bias at the last image is that at the first and what it has walked.
  Eigen::Matrix<double, 27, 27> from = Eigen::Matrix<double, 27, 27>::Zero();
  from.topLeftCorner<21, 21>().setIdentity();
  from.block<6, 6>(21, 15).setIdentity();
  int column = 21;
  const auto addWalk = [&](int row, int block) {
    blocks.push_back(block);
    from.block<3, 3>(row, column).setIdentity();
    column += 3;
  };
  if (problem.walks().gyroscope) addWalk(21, problem.gyroscopeWalkBlock(end));
  if (problem.walks().accelerometer) addWalk(24, problem.accelerometerWalkBlock(end));
  Eigen::Matrix<double, 27, 27> unknowns = Eigen::Matrix<double, 27, 27>::Zero();
  const std::vector<double> inverse = system.inverse(blocks);
  unknowns.topLeftCorner(column, column) =
      Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(inverse.data(), column,
                                                                                               column);
  return congruence(from, unknowns);
}

/// The relative standard deviation of the scale of the images' positions p: of Σ p·δp / Σ p².
inline double scaleSigma(const RefinementProblem& problem, const ReducedSystem& system) {
  const std::vector<SE23d>& X = problem.state().X;
  std::vector<double> gradient(3 * static_cast<std::size_t>(problem.blocks()));
  double squares = 0;
  for (std::size_t j = 1; j < X.size(); ++j) {
    const Eigen::Vector3d p = X[j].translation(), in_body = X[j].so3().inverse() * p;
    squares += p.squaredNorm();
    const std::size_t first = 3 * static_cast<std::size_t>(problem.stateBlock(j, 0));
    for (std::size_t k = 0; k < 3; ++k) gradient[first + k] = in_body[static_cast<int>(k)];
  }
  return std::sqrt(system.variance(gradient)) / squares;
}

/// The probability of a bias that is off the prior's mean by so much: estimates of biases from a prior of variance σ²
/// scatter about its mean by σ² less their own covariance.
inline double probabilityUnderPrior(const Eigen::Vector3d& off, const Eigen::Matrix3d& covariance, double sigma) {
  // A hundredth keeps it regular where the data say nothing.
  const Eigen::Matrix3d scatter = 1.01 * Eigen::Matrix3d::Identity() - covariance / (sigma * sigma);
  const Cholesky<double, 3> factor(scatter);
  if (!factor.ok()) return 1;
  return chiSquaredTail(factor.halfSolve<1>(Eigen::Vector3d(off / sigma)).squaredNorm(), 3);
}

/// Sets prior_p, tilt_sigma and, of a converged estimate, the status, by covariance and prior.
inline void judge(RefinementResult& result, const InitialisationOptions& options, bool at_rest) {
  const BiasPrior& prior = options.prior;
  using Block = InitialCovariance::Block;
  const double gyroscope = probabilityUnderPrior(result.bias.gyroscope - prior.mean.gyroscope,
                                                 result.covariance.of<Block::gyroscope_bias>(), prior.gyroscope_sigma);
  const double accelerometer =
      probabilityUnderPrior(result.bias.accelerometer - prior.mean.accelerometer,
                            result.covariance.of<Block::accelerometer_bias>(), prior.accelerometer_sigma);
  result.prior_p = std::min(1., 2 * std::min(gyroscope, accelerometer));
  result.tilt_sigma = tiltSigma(result.gravity, result.covariance.of<Block::gravity>());
  if (result.status != FusionStatus::ok) return;
  if (!(result.tilt_sigma <= options.closed_form.max_tilt_sigma)) {
    result.status = FusionStatus::gravity_undetermined;
  } else if (!at_rest && !(result.scale_sigma <= options.closed_form.max_scale_sigma)) {
    result.status = FusionStatus::scale_unobservable;
  }
}

/// One refinement with the motions as they are; at rest: with velocities and displacements of zero. `former`, if there
/// is one, has the states to start from.
inline RefinementResult refineOnce(const InertialWindow& window, const ClosedFormSolution& start,
                                   const ImuBias<double>& bias, const InitialisationOptions& options, bool at_rest,
                                   const RefinementResult* former) {
  RefinementResult result;
  RefinementProblem problem(window, options);
  if (at_rest) problem.holdStill();
  if (!problem.setWeights()) {
    result.status = FusionStatus::bad_motion;
    return result;
  }
  problem.start(start, bias, former);
  if (problem.features().empty()) {
    result.status = FusionStatus::no_start;
    return result;
  }
  ReducedSystem system(problem.blocks(), problem.features().size());
  const DampedSummary summary = minimiseDamped(
      problem, system,
      {.max_iterations = options.refinement.max_iterations, .min_decrease = options.refinement.min_decrease});
  const RefinementProblem::State& best = problem.state();
  result.states = best.X;
  result.gravity = best.gravity;
  result.bias = best.bias.front();
  result.last_bias = best.bias.back();
  result.features.assign(window.features.size(), Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (std::size_t i = 0; i < best.P.size(); ++i) result.features[problem.features()[i]] = best.P[i];
  result.cost = summary.cost;
  result.iterations = summary.iterations;
  result.features_used = best.P.size();
  result.observations_used = problem.observations();
  // Motions and the priors have as many rows as states and biases: what is left are V, G and the features.
  // At rest motions have six more rows, and there are neither V nor depths.
  const std::size_t gravity = options.gravity ? 2 : 3;
  const std::size_t rows = 2 * problem.observations() + (at_rest ? 6 * window.motions().size() : 0);
  const std::size_t unknowns = at_rest ? 2 * best.P.size() + gravity : 3 * best.P.size() + 3 + gravity;
  result.degrees_of_freedom = rows > unknowns ? rows - unknowns : 0;
  result.must_reintegrate = window.isFar(best.bias.front()) || window.isFar(best.bias.back());
  if (!system.factor(0)) {
    result.status = FusionStatus::undetermined;
    return result;
  }
  // Without iterations the start is the answer.
  result.status = options.refinement.max_iterations == 0 ? FusionStatus::ok : summary.status;
  result.covariance.joint = jointCovariance(problem, system);
  if (!at_rest) result.scale_sigma = scaleSigma(problem, system);
  judge(result, options, at_rest);
  if (at_rest && result.status == FusionStatus::ok) {
    const std::size_t readings = 6 * window.motions().size() - gravity;
    const bool still = chiSquaredTail(problem.inertialCost(), readings) >= 1e-3;
    result.status = still ? FusionStatus::stationary : FusionStatus::no_parallax;
  }
  return result;
}

}  // namespace detail

namespace detail {

inline RefinementResult refineFrom(InertialWindow window, const ClosedFormSolution& start,
                                   const ImuBias<double>& start_bias, const InitialisationOptions& options,
                                   bool at_rest, const RefinementResult* former = nullptr) {
  RefinementResult result;
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  const BiasPrior& prior = options.prior;
  const bool finite = start.velocity.allFinite() && positive(start.gravity.norm()) &&
                      start.accelerometer_bias.allFinite() && start_bias.gyroscope.allFinite() &&
                      start_bias.accelerometer.allFinite() && prior.mean.gyroscope.allFinite() &&
                      prior.mean.accelerometer.allFinite();
  result.fault = window.fault();
  if (!result.fault && (!finite || !positive(options.bearing_noise) || !positive(prior.gyroscope_sigma) ||
                        !positive(prior.accelerometer_sigma) || !positive(options.inertial_noise_factor))) {
    result.fault = FaultKind::bad_option;
  }
  if (result.fault) return result;
  ImuBias<double> bias{start_bias.gyroscope, start_bias.accelerometer + start.accelerometer_bias};
  result.fault = detail::faultOf(closedFormWindow(window, bias), options);
  if (result.fault) return result;
  ClosedFormSolution from = start;
  int integrations = window.integrateIfFar(bias);
  for (;;) {
    result = detail::refineOnce(window, from, bias, options, at_rest, former);
    result.integrations = integrations;
    former = nullptr;
    if (!result.must_reintegrate || integrations >= options.refinement.max_integrations) return result;
    // Too far for a first-order update: the readings again with these biases, and on from there.
    if (!window.integrateIfFar(result.bias)) return result;
    ++integrations;
    bias = result.bias;
    from = {.velocity = result.velocity(), .gravity = result.gravity, .features = result.features};
  }
}

}  // namespace detail

LIESTAT_FUSION_INLINE RefinementResult refine(InertialWindow window, const ClosedFormSolution& start,
                                              const ImuBias<double>& start_bias, const InitialisationOptions& options) {
  return detail::refineFrom(std::move(window), start, start_bias, options, false);
}

LIESTAT_FUSION_INLINE RefinementResult refine(InertialWindow window, const RefinementResult& former,
                                              const InitialisationOptions& options) {
  const ClosedFormSolution start{.velocity = former.velocity(), .gravity = former.gravity, .features = former.features};
  return detail::refineFrom(std::move(window), start, former.bias, options, false, &former);
}

LIESTAT_FUSION_INLINE RefinementResult refineAtRest(InertialWindow window, const Eigen::Vector3d& gravity,
                                                    const ImuBias<double>& start_bias,
                                                    const InitialisationOptions& options) {
  // Depths are free: anywhere in front of the camera will do.
  ClosedFormSolution rest;
  rest.gravity = gravity;
  const std::vector<BiasedImage> images = biasedImages(window.motions(), start_bias);
  for (const FeatureTrack& track : window.features) {
    rest.features.push_back(Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
    if (track.empty() || track.front().image >= images.size() || track.front().camera >= window.cameras.size())
      continue;
    const TrackedBearing& seen = track.front();
    rest.features.back() = images[seen.image].image.rotation *
                           (window.cameras[seen.camera] * Eigen::Vector3d(10 * seen.bearing.normalized()));
  }
  RefinementResult result = detail::refineFrom(std::move(window), rest, start_bias, options, true);
  result.features.clear();
  return result;
}

}  // namespace liestat
