// Refinement of a visual-inertial initialisation: the most probable states at all images, gravity, biases and features,
// given the bearings, the inertial sensor's motions with their covariance, and what is known of the biases beforehand.
//
//   const auto refined = liestat::refine(window, found.result.solutions[0], {.gyroscope = found.bias}, options);
//   if (refined.ok()) … refined.velocity(), refined.gravity, refined.covariance.atLast(), refined.states.back()
//
// Unlike the closed form's, its covariance contains all that is modelled: image noise, the inertial sensor's noise and
// its biases. Source: the design note on visual-inertial initialisation, section 3.7; C. Forster et al., "On-manifold
// preintegration", IEEE T-RO 33, 2017; features are eliminated one by one (B. Triggs et al., "Bundle adjustment - a
// modern synthesis", 2000, section 6.1), and what remains is minimised by Levenberg's and Marquardt's method: plain
// Gauss–Newton fails from short windows.
#pragma once

#include <fusion/detail/closed_form_input.hpp>
#include <fusion/detail/refinement_problem.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/closed_form_types.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace liestat {

/// The joint covariance of all that a refinement tells but the states between the first and the last: 21 unknowns in
/// blocks of three. The last state's are its right tangent; gravity is in the axes of t0, and singular along itself
/// where its length is known. Position and heading of t0's frame are exact by definition.
struct InitialCovariance {
  /// The first row of each block.
  enum Block {
    first_velocity = 0,      ///< V, at t0 (m/s)
    last_position = 3,       ///< m
    last_rotation = 6,       ///< rad
    last_velocity = 9,       ///< m/s
    gravity = 12,            ///< G (m/s²)
    gyroscope_bias = 15,     ///< rad/s
    accelerometer_bias = 18  ///< m/s²
  };
  Eigen::Matrix<double, 21, 21> joint = Eigen::Matrix<double, 21, 21>::Zero();

  Eigen::Matrix3d block(Block row, Block column) const { return joint.block<3, 3>(row, column); }
  /// Of some blocks, in their order.
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
  /// Of (V, G, gyroscope's bias, accelerometer's bias) at t0.
  Eigen::Matrix<double, 12, 12> atFirst() const {
    return of<first_velocity, gravity, gyroscope_bias, accelerometer_bias>();
  }
  /// Of the last state (position, rotation, velocity), then G and both biases: what a filter starts from.
  Eigen::Matrix<double, 18, 18> atLast() const { return joint.bottomRightCorner<18, 18>(); }
};

/// Everything is in the body's axes at the first image, t0.
struct RefinementResult {
  /// ok, not_converged, undetermined, no_start (the start has no feature in front of its cameras), bad_motion or
  /// bad_input (then see fault).
  FusionStatus status = FusionStatus::bad_input;
  Fault fault;

  std::vector<SE23d> states;  ///< at each image: orientation, position, velocity; the first at the identity and 0
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
  ImuBias<double> bias;                   ///< whole: not the change of the one that was integrated
  std::vector<Eigen::Vector3d> features;  ///< NaN for a feature that was not used

  /// Of the state from which a filter starts, and of what came before it.
  InitialCovariance covariance;

  double cost = 0;  ///< χ² of bearings, motions and priors
  std::size_t degrees_of_freedom = 0;
  std::size_t features_used = 0, observations_used = 0;
  int iterations = 0;
  int integrations = 0;           ///< how often the readings were integrated anew
  bool must_reintegrate = false;  ///< the biases have gone too far for a first-order update, and the window can't help

  Eigen::Vector3d velocity() const {
    return states.empty() ? Eigen::Vector3d::Zero() : Eigen::Vector3d(states[0].velocity());
  }
  /// Whether the cost is one of noise: five sigmas of χ².
  bool consistent() const {
    const double dof = static_cast<double>(degrees_of_freedom);
    return cost <= dof + 5 * std::sqrt(2 * dof) + 12;
  }
  /// Exactly one answer, converged, that explains the data.
  bool ok() const { return status == FusionStatus::ok && consistent() && !must_reintegrate; }
};

namespace detail {

/// One refinement with the motions as they are.
inline RefinementResult refineOnce(const InertialWindow& window, const ClosedFormSolution& start,
                                   const ImuBias<double>& bias, const InitialisationOptions& options) {
  RefinementResult result;
  RefinementProblem problem(window, options);
  if (!problem.setWeights()) {
    result.status = FusionStatus::bad_motion;
    return result;
  }
  problem.start(start, bias);
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
  result.bias = best.bias;
  result.features.assign(window.features.size(), Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN()));
  for (std::size_t i = 0; i < best.P.size(); ++i) result.features[problem.features()[i]] = best.P[i];
  result.cost = summary.cost;
  result.iterations = summary.iterations;
  result.features_used = best.P.size();
  result.observations_used = problem.observations();
  // Motions and the priors have as many rows as states and biases: what is left are V, G and the features.
  const std::size_t rows = 2 * problem.observations(), unknowns = 3 * best.P.size() + (options.gravity ? 5 : 6);
  result.degrees_of_freedom = rows > unknowns ? rows - unknowns : 0;
  result.must_reintegrate = window.isFar(best.bias);
  if (!system.factor(0)) {
    result.status = FusionStatus::undetermined;
    return result;
  }
  result.status = summary.converged ? FusionStatus::ok : FusionStatus::not_converged;
  const int g = problem.gravityBlock();
  const auto last = [&](int part) { return problem.stateBlock(best.X.size() - 1, part); };
  const std::vector<double> inverse =
      system.inverse({problem.stateBlock(0, 2), last(0), last(1), last(2), g, g + 1, g + 2});
  result.covariance.joint = Eigen::Map<const Eigen::Matrix<double, 21, 21>>(inverse.data());
  return result;
}

}  // namespace detail

/// The most probable motion next to a start: a solution of the closed form, and the biases with which it was found (its
/// own correction of the accelerometer's is added). The motions must have been integrated with the sensor's noise; where
/// the biases go too far for their first-order update, the window is integrated anew and refined on from there.
inline RefinementResult refine(InertialWindow window, const ClosedFormSolution& start,
                               const ImuBias<double>& start_bias, const InitialisationOptions& options) {
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
    result = detail::refineOnce(window, from, bias, options);
    result.integrations = integrations;
    if (!result.must_reintegrate || integrations >= options.refinement.max_integrations) return result;
    // Too far for a first-order update: the readings again with these biases, and on from there.
    if (!window.integrateIfFar(result.bias)) return result;
    ++integrations;
    bias = result.bias;
    from = {.velocity = result.velocity(), .gravity = result.gravity, .features = result.features};
  }
}

}  // namespace liestat
