// Refinement of a visual-inertial initialisation: the most probable states at all images, gravity, biases and features,
// given the bearings, the inertial sensor's motions with their covariance, and what is known of the biases beforehand.
//
//   const auto refined = liestat::refine(window, found.result.solutions[0], {.gyroscope = found.bias}, options);
//   if (refined.ok()) … refined.velocity(), refined.gravity, refined.covariance, refined.states.back()
//
// Unlike the closed form's, its covariance contains all that is modelled: image noise, the inertial sensor's noise and
// its biases. Source: the design note on visual-inertial initialisation, section 3.7; C. Forster et al., "On-manifold
// preintegration", IEEE T-RO 33, 2017; features are eliminated one by one (B. Triggs et al., "Bundle adjustment - a
// modern synthesis", 2000, section 6.1), and what remains is minimised by Levenberg's and Marquardt's method: plain
// Gauss-Newton fails from short windows.
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <fusion/detail/closed_form_input.hpp>
#include <fusion/detail/reduced_system.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/imu/factor.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace liestat {

struct RefinementOptions {
  double bearing_noise = 0;               ///< rad, as of the closed form; must be given
  std::optional<double> gravity = 9.81;   ///< |G| in m/s²; none: its length is an unknown too
  ImuBias<double> prior = {};             ///< biases as they are expected, and their deviations
  double gyroscope_deviation = 0.01;      ///< rad/s
  double accelerometer_deviation = 0.05;  ///< m/s²
  /// Of the deviations of the motions: data sheets tell the noise of a sensor at rest, and on real recordings errors
  /// are larger (scale factors, vibration, time stamps).
  double inertial_noise_factor = 1;
  int most_iterations = 50;
  double least_decrease = 1e-3;  ///< of the cost (χ²): below it, it has converged
};

/// What each of n windows that are to be fused (fusion/init/window_fusion.hpp) is refined with, so that all together count
/// the prior of the biases once: deviations √n times as large.
inline RefinementOptions withSharedPrior(RefinementOptions options, std::size_t n) {
  const double root = std::sqrt(static_cast<double>(n));
  options.gyroscope_deviation *= root;
  options.accelerometer_deviation *= root;
  return options;
}

enum class RefinementStatus {
  ok,
  not_converged,  ///< the iterations ended first
  singular,       ///< the data and the priors do not determine all unknowns
  no_feature,     ///< the start has none in front of its cameras
  bad_motion,     ///< a motion without a positive definite covariance (no noise was given), or not finite
  bad_input       ///< the window or the options: see fault
};

/// In words, for people.
inline const char* describe(RefinementStatus status) {
  switch (status) {
    case RefinementStatus::ok:
      return "refined";
    case RefinementStatus::not_converged:
      return "the refinement did not converge";
    case RefinementStatus::singular:
      return "the data and the priors do not determine all unknowns";
    case RefinementStatus::no_feature:
      return "the start has no feature in front of its cameras";
    case RefinementStatus::bad_motion:
      return "a motion has no positive definite covariance: was the sensor's noise given?";
    case RefinementStatus::bad_input:
      return "bad input";
  }
  return "";
}

/// Everything is in the body's axes at the first image, t0.
struct RefinementResult {
  RefinementStatus status = RefinementStatus::bad_input;
  ClosedFormFault fault = ClosedFormFault::none;
  std::size_t fault_index = 0;

  std::vector<SE23d> states;  ///< at each image: orientation, position, velocity; the first at the identity and 0
  Eigen::Vector3d gravity = Eigen::Vector3d::Zero();
  ImuBias<double> bias;                   ///< whole: not the change of the one that was integrated
  std::vector<Eigen::Vector3d> features;  ///< NaN for a feature that was not used

  /// Of (V, G, gyroscope's bias, accelerometer's bias), V the velocity at t0. Singular along G where |G| is known.
  Eigen::Matrix<double, 12, 12> covariance = Eigen::Matrix<double, 12, 12>::Zero();
  /// Of the last state in its right tangent (position, rotation, velocity), then G and both biases: what a filter
  /// starts from. In t0's frame, whose position and heading are exact by definition.
  Eigen::Matrix<double, 18, 18> last_covariance = Eigen::Matrix<double, 18, 18>::Zero();
  /// Of the last state, rows as above, with V.
  Eigen::Matrix<double, 9, 3> last_velocity_covariance = Eigen::Matrix<double, 9, 3>::Zero();

  double cost = 0;  ///< χ² of bearings, motions and priors
  std::size_t degrees_of_freedom = 0;
  std::size_t features_used = 0, observations_used = 0;
  int iterations = 0;
  bool must_reintegrate = false;  ///< the biases have gone too far for a first-order update: integrate, refine again

  Eigen::Vector3d velocity() const {
    return states.empty() ? Eigen::Vector3d::Zero() : Eigen::Vector3d(states[0].velocity());
  }
  /// Whether the cost is one of noise: five deviations of χ².
  bool consistent() const {
    const double dof = static_cast<double>(degrees_of_freedom);
    return cost <= dof + 5 * std::sqrt(2 * dof) + 12;
  }
  bool ok() const { return status == RefinementStatus::ok && consistent() && !must_reintegrate; }
};

namespace detail {

/// The rows of a motion between two images: the residual's covariance, whitened.
struct MotionWeight {
  Eigen::Matrix<double, 9, 9> root;  ///< lower triangular, rootᵀ root = covariance⁻¹

  /// False where the covariance is not positive definite.
  bool set(const Eigen::Matrix<double, 9, 9>& covariance, double factor) {
    Eigen::Matrix<double, 9, 9> L = Eigen::Matrix<double, 9, 9>::Zero();
    root.setZero();
    for (int i = 0; i < 9; ++i) {
      for (int j = 0; j <= i; ++j) {
        double sum = covariance(i, j);
        for (int k = 0; k < j; ++k) sum -= L(i, k) * L(j, k);
        if (i == j && (!(sum > 0) || !std::isfinite(sum))) return false;
        L(i, j) = i == j ? std::sqrt(sum) : sum / L(j, j);
      }
    }
    for (int c = 0; c < 9; ++c) {
      for (int i = c; i < 9; ++i) {
        double sum = i == c ? 1 / factor : 0;
        for (int k = c; k < i; ++k) sum -= L(i, k) * root(k, c);
        root(i, c) = sum / L(i, i);
      }
    }
    return true;
  }
  /// root times a matrix of nine rows, from its column on.
  template <class Matrix>
  Eigen::Matrix<double, 9, 3> times(const Matrix& J, int column) const {
    Eigen::Matrix<double, 9, 3> result = Eigen::Matrix<double, 9, 3>::Zero();
    for (int k = 0; k < 9; ++k) {
      for (int i = k; i < 9; ++i) {
        for (int c = 0; c < 3; ++c) result(i, c) += root(i, k) * J(k, column + c);
      }
    }
    return result;
  }
};

/// The posterior as a function of states, G, biases and features. Blocks: v of all images, then (p, φ) of each but the
/// first, then G, b_g, b_a: velocities, which only motions tie to other unknowns, are eliminated while rows are sparse.
class RefinementProblem {
 public:
  struct State {
    std::vector<SE23d> X;
    Eigen::Vector3d gravity;
    ImuBias<double> bias;
    std::vector<Eigen::Vector3d> P;
  };

  RefinementProblem(const InertialWindow& window, const RefinementOptions& options)
      : window_(window), options_(options) {}

  /// False where a motion has no covariance.
  bool setWeights() {
    for (const Preintegration<double>& motion : window_.motions) {
      weights_.emplace_back();
      if (!weights_.back().set(motion.gaussian().covariance, options_.inertial_noise_factor)) return false;
    }
    return true;
  }
  /// Starts at a solution; features that are not in front of all their cameras are left out.
  void start(const ClosedFormSolution& s, const ImuBias<double>& bias) {
    state_.bias = bias;
    state_.gravity = s.gravity;
    if (options_.gravity) state_.gravity *= *options_.gravity / s.gravity.norm();
    for (const BiasedImage& b : biasedImages(window_.motions, bias)) {
      const double t = b.image.time;
      state_.X.emplace_back(SO3d(b.image.rotation),
                            Eigen::Vector3d(t * s.velocity + (0.5 * t * t) * state_.gravity + b.image.displacement),
                            Eigen::Vector3d(s.velocity + t * state_.gravity + b.speed));
    }
    for (std::size_t i = 0; i < window_.features.size() && i < s.features.size(); ++i) {
      const FeatureTrack& track = window_.features[i];
      const auto isBehind = [&](const TrackedBearing& seen) {
        return !(seen.bearing.dot(inCamera(state_.X[seen.image], s.features[i])) > 0);
      };
      if (track.size() < 2 || !s.features[i].allFinite() || std::any_of(track.begin(), track.end(), isBehind)) continue;
      for (const TrackedBearing& seen : track) {
        const Eigen::Vector3d bearing = seen.bearing.normalized();
        observations_.push_back({state_.P.size(), seen.image, bearing, tangentRows(bearing), seen.deviation});
      }
      state_.P.push_back(s.features[i]);
      feature_.push_back(i);
    }
  }

  const State& state() const { return state_; }
  const std::vector<std::size_t>& features() const { return feature_; }
  std::size_t observations() const { return observations_.size(); }
  int blocks() const { return gravityBlock() + 3; }
  int gravityBlock() const { return 3 * static_cast<int>(state_.X.size()) - 2; }
  /// Of the part of a state: 0 position, 1 rotation, 2 velocity. The first state has the velocity alone.
  int stateBlock(std::size_t j, int part) const {
    const int images = static_cast<int>(state_.X.size()), image = static_cast<int>(j);
    return part == 2 ? image : images + 2 * (image - 1) + part;
  }

  double linearise(ReducedSystem& system) {
    system.clear();
    return run(state_, &system);
  }
  double costAfter(const ReducedSystem& system) {
    next_ = state_;
    next_.X[0].velocity() += system.shared(stateBlock(0, 2));
    for (std::size_t j = 1; j < next_.X.size(); ++j) {
      Eigen::Matrix<double, 9, 1> step;
      step << system.shared(stateBlock(j, 0)), system.shared(stateBlock(j, 1)), system.shared(stateBlock(j, 2));
      if (!step.allFinite()) return std::numeric_limits<double>::infinity();
      next_.X[j] *= SE23d::exp(step);
    }
    const int g = gravityBlock();
    next_.gravity += system.shared(g);
    if (options_.gravity) next_.gravity *= *options_.gravity / next_.gravity.norm();
    next_.bias.gyroscope += system.shared(g + 1);
    next_.bias.accelerometer += system.shared(g + 2);
    for (std::size_t i = 0; i < next_.P.size(); ++i) next_.P[i] += system.feature(i);
    return run(next_, nullptr);
  }
  void accept() { std::swap(state_, next_); }

 private:
  struct Observation {
    std::size_t feature, image;
    Eigen::Vector3d bearing;
    Eigen::Matrix<double, 2, 3> across;
    double deviation;
  };

  Eigen::Vector3d inCamera(const SE23d& X, const Eigen::Vector3d& P) const {
    return X.so3().inverse() * Eigen::Vector3d(P - X.translation()) - window_.camera;
  }

  double run(const State& state, ReducedSystem* system) const {
    double cost = 0;
    for (std::size_t k = 0; k < window_.motions.size(); ++k) cost += addMotion(state, k, system);
    const int g = gravityBlock();
    cost += addPrior(state.bias.gyroscope - options_.prior.gyroscope, options_.gyroscope_deviation, g + 1, system);
    cost += addPrior(state.bias.accelerometer - options_.prior.accelerometer, options_.accelerometer_deviation, g + 2,
                     system);
    if (system && options_.gravity) {
      // A stiff row along G: its length has no freedom.
      ResidualRows rows(1);
      rows.value[0] = 0;
      rows.add(g, Eigen::Matrix<double, 1, 3>(1e6 * state.gravity.normalized().transpose()));
      system->add(rows);
    }
    Eigen::Matrix<double, 2, 3> by_d;
    std::size_t image = state.X.size();
    Eigen::Matrix3d back = Eigen::Matrix3d::Identity();  // of the image last seen
    for (const Observation& seen : observations_) {
      if (seen.image != image) {
        image = seen.image;
        back = state.X[image].so3().matrix().transpose();
      }
      const Eigen::Vector3d b = back * (state.P[seen.feature] - state.X[image].translation());
      ResidualRows rows(2);
      if (!bearingResidual(b - window_.camera, seen.across, seen.bearing, seen.deviation * options_.bearing_noise, rows,
                           by_d)) {
        return std::numeric_limits<double>::infinity();
      }
      cost += rows.squared();
      if (!system) continue;
      if (image > 0) {
        // X Exp(δ): the point moves by -δp + b × δφ in the body.
        rows.add(stateBlock(image, 0), Eigen::Matrix<double, 2, 3>(-by_d));
        rows.add(stateBlock(image, 1), Eigen::Matrix<double, 2, 3>(by_d * skew(b)));
      }
      system->add(rows, seen.feature, Eigen::Matrix<double, 2, 3>(by_d * back));
    }
    return cost;
  }

  double addMotion(const State& state, std::size_t k, ReducedSystem* system) const {
    const SE23d &from = state.X[k], &to = state.X[k + 1];
    const MotionWeight& weight = weights_[k];
    ResidualRows rows(9);
    const auto set = [&](const Eigen::Matrix<double, 9, 1>& value) {
      for (int i = 0; i < 9; ++i) {
        double sum = 0;
        for (int j = 0; j <= i; ++j) sum += weight.root(i, j) * value[j];
        rows.value[static_cast<std::size_t>(i)] = sum;
      }
      return rows.squared();
    };
    if (!system) {
      return set(preintegrationError<double>(window_.motions[k], from, to, state.bias, state.gravity));
    }
    const PreintegrationResidual<double> r =
        preintegrationResidual<double>(window_.motions[k], from, to, state.bias, state.gravity);
    const double cost = set(r.value);
    for (int c = k == 0 ? 2 : 0; c < 3; ++c) rows.add(stateBlock(k, c), weight.times(r.by_first, 3 * c));
    for (int c = 0; c < 3; ++c) rows.add(stateBlock(k + 1, c), weight.times(r.by_second, 3 * c));
    rows.add(gravityBlock(), weight.times(r.by_gravity, 0));
    rows.add(gravityBlock() + 1, weight.times(r.by_bias, 0));
    rows.add(gravityBlock() + 2, weight.times(r.by_bias, 3));
    system->add(rows);
    return cost;
  }

  static double addPrior(const Eigen::Vector3d& error, double deviation, int block, ReducedSystem* system) {
    ResidualRows rows(3);
    rows.add(block, Eigen::Matrix3d(Eigen::Matrix3d::Identity() / deviation));
    for (int k = 0; k < 3; ++k) rows.value[static_cast<std::size_t>(k)] = error[k] / deviation;
    if (system) system->add(rows);
    return rows.squared();
  }

  const InertialWindow& window_;
  const RefinementOptions& options_;
  State state_, next_;
  std::vector<MotionWeight> weights_;
  std::vector<Observation> observations_;
  std::vector<std::size_t> feature_;
};

}  // namespace detail

/// The most probable motion next to a start: a solution of the closed form, and the biases with which it was found (its
/// own correction of the accelerometer's is added). The motions must have been integrated with the sensor's noise.
inline RefinementResult refine(const InertialWindow& window, const ClosedFormSolution& start,
                               const ImuBias<double>& start_bias, const RefinementOptions& options) {
  RefinementResult result;
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  const bool finite = start.velocity.allFinite() && positive(start.gravity.norm()) &&
                      start.accelerometer_bias.allFinite() && start_bias.gyroscope.allFinite() &&
                      start_bias.accelerometer.allFinite() && options.prior.gyroscope.allFinite() &&
                      options.prior.accelerometer.allFinite();
  if (!finite || !positive(options.bearing_noise) || !positive(options.gyroscope_deviation) ||
      !positive(options.accelerometer_deviation) || !positive(options.inertial_noise_factor)) {
    result.fault = ClosedFormFault::bad_option;
    return result;
  }
  const ImuBias<double> bias{start_bias.gyroscope, start_bias.accelerometer + start.accelerometer_bias};
  result.fault =
      detail::faultOf(closedFormWindow(window, bias),
                      {.gravity = options.gravity, .bearing_noise = options.bearing_noise}, result.fault_index);
  if (result.fault != ClosedFormFault::none) return result;
  detail::RefinementProblem problem(window, options);
  if (!problem.setWeights()) {
    result.status = RefinementStatus::bad_motion;
    return result;
  }
  problem.start(start, bias);
  if (problem.features().empty()) {
    result.status = RefinementStatus::no_feature;
    return result;
  }
  detail::ReducedSystem system(problem.blocks(), problem.features().size());
  const detail::DampedSummary summary =
      detail::minimiseDamped(problem, system, options.most_iterations, options.least_decrease);
  const detail::RefinementProblem::State& best = problem.state();
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
  result.must_reintegrate = std::any_of(window.motions.begin(), window.motions.end(),
                                        [&](const auto& motion) { return motion.mustReintegrate(best.bias); });
  if (!system.factor(0)) {
    result.status = RefinementStatus::singular;
    return result;
  }
  result.status = summary.converged ? RefinementStatus::ok : RefinementStatus::not_converged;
  const int g = problem.gravityBlock();
  const auto last = [&](int part) { return problem.stateBlock(best.X.size() - 1, part); };
  const std::vector<double> inverse =
      system.inverse({problem.stateBlock(0, 2), last(0), last(1), last(2), g, g + 1, g + 2});
  const Eigen::Map<const Eigen::Matrix<double, 21, 21>> joint(inverse.data());
  result.covariance << joint.topLeftCorner<3, 3>(), joint.topRightCorner<3, 9>(), joint.bottomLeftCorner<9, 3>(),
      joint.bottomRightCorner<9, 9>();
  result.last_covariance = joint.bottomRightCorner<18, 18>();
  result.last_velocity_covariance = joint.block<9, 3>(3, 0);
  return result;
}

}  // namespace liestat
