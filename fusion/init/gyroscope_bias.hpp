// The gyroscope's bias out of a window: the closed form is not robust to it (0.05 rad/s cost a sixth of the scale and
// two degrees of gravity over two seconds), and has no linear unknown for it.
//
//   const auto found = liestat::estimateGyroscopeBias(window, {.bearing_noise = 1. / 450});
//   if (found.ok()) … found.bias, found.covariance, found.result.solutions[0]
//
// The outer problem over the bias of the design note, section 3.6: the bearings' angles as a function of the bias, with
// velocity, gravity and features the best for each, by damped Gauss–Newton with these eliminated. Angles of predicted
// directions are minimised, not the linear system's residuals: those shrink with the scene, and a large bias that lets
// depths collapse makes them small. Each round begins at the closed form for the bias that the last one found.
#pragma once

#include <fusion/init/closed_form.hpp>
#include <fusion/detail/bearing_rows.hpp>
#include <fusion/detail/reduced_system.hpp>
#include <fusion/imu/window.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

namespace liestat {

/// The result of estimateGyroscopeBias().
struct GyroscopeBiasResult {
  /// ok, not_converged, no_start (then see result.status), window_too_short or bad_input (then see result.fault).
  FusionStatus status = FusionStatus::bad_input;
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();  ///< rad/s, whole: not the change of the one that was integrated
  /// From image noise and the prior; without the inertial sensor's noise.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  ClosedFormResult result;  ///< for this bias
  double cost = 0;          ///< Σ (angle/noise)² and the priors
  int rounds = 0, iterations = 0;
  int integrations = 0;  ///< how often the readings were integrated anew

  /// Exactly one answer, converged, that explains the data.
  bool ok() const { return status == FusionStatus::ok && result.ok(); }
};

namespace detail {

/// Angles as a function of (V, G, b_g, [b_a]) and features.
class GyroscopeBiasProblem {
 public:
  enum Block { velocity, gravity, gyroscope, accelerometer };
  struct State {
    Eigen::Vector3d velocity, gravity, gyroscope, accelerometer;
    std::vector<Eigen::Vector3d> P;
    std::vector<BiasedImage> images;
  };

  /// Starts at the first solution, with the features that are in front; `base` is the bias of the readings.
  GyroscopeBiasProblem(const InertialWindow& window, const InitialisationOptions& options,
                       const ClosedFormResult& start, const Eigen::Vector3d& bias, const ImuBias<double>& base)
      : window_(window), options_(options), base_(base) {
    const ClosedFormSolution& s = start.solutions[0];
    state_ = {s.velocity, s.gravity, bias, s.accelerometer_bias, {}, {}};
    setImages(state_);
    for (std::size_t i = 0; i < window.features.size(); ++i) {
      if (!start.features[i].used || !s.features[i].allFinite() || !isInFront(window.features[i], s.features[i])) {
        continue;
      }
      state_.P.push_back(s.features[i]);
      for (const TrackedBearing& seen : window.features[i]) {
        observations_.emplace_back(window, seen, state_.P.size() - 1);
      }
    }
  }

  const State& state() const { return state_; }
  std::size_t features() const { return state_.P.size(); }
  int blocks() const { return options_.closed_form.estimate_bias ? 4 : 3; }

  double linearise(ReducedSystem& system) {
    system.clear();
    return run(state_, &system);
  }
  double costAfter(const ReducedSystem& system) {
    next_ = state_;
    const Eigen::Vector3d turn = system.shared(gyroscope);
    if (!(turn.norm() <= options_.gyroscope_bias.max_step)) return std::numeric_limits<double>::infinity();
    next_.velocity += system.shared(velocity);
    takeStep(system, gravity, options_.gravity, next_.gravity, next_.P);
    next_.gyroscope += turn;
    if (blocks() == 4) next_.accelerometer += system.shared(accelerometer);
    setImages(next_);
    return run(next_, nullptr);
  }
  void accept() { std::swap(state_, next_); }

 private:
  void setImages(State& state) const {
    state.images = biasedImages(window_.motions(), {state.gyroscope, base_.accelerometer + state.accelerometer});
  }
  /// From image j, in t0's axes, without the lever arm.
  static Eigen::Vector3d fromImage(const State& state, const WindowImage& image, const Eigen::Vector3d& P) {
    const double t = image.time;
    return P - t * state.velocity - (0.5 * t * t) * state.gravity - image.displacement;
  }
  bool isInFront(const FeatureTrack& track, const Eigen::Vector3d& P) const {
    for (const TrackedBearing& seen : track) {
      const WindowImage& image = state_.images[seen.image].image;
      const Eigen::Vector3d d =
          image.rotation.transpose() * fromImage(state_, image, P) - window_.cameras[seen.camera].translation();
      if (!(d.dot(bearingInBody(window_.cameras, seen)) > 0)) return false;
    }
    return true;
  }
  /// The cost, infinite where a feature is behind its camera; and derivatives, if asked for.
  double run(const State& state, ReducedSystem* system) const {
    double cost = 0;
    Eigen::Matrix<double, 2, 3> by_d;
    for (const BearingObservation& seen : observations_) {
      const BiasedImage& biased = state.images[seen.image];
      const WindowImage& image = biased.image;
      const Eigen::Vector3d x = fromImage(state, image, state.P[seen.feature]);
      const Eigen::Vector3d d = image.rotation.transpose() * x - seen.lever;
      ResidualRows rows(2);
      if (!bearingResidual(d, seen, options_.bearing_noise, rows, by_d)) {
        return std::numeric_limits<double>::infinity();
      }
      cost += rows.squared();
      if (!system) continue;
      const Eigen::Matrix<double, 2, 3> J = by_d * image.rotation.transpose();
      rows.add(velocity, -image.time * J);
      rows.add(gravity, (-0.5 * image.time * image.time) * J);
      // d of Exp(-A δ) x is x × (A δ).
      rows.add(gyroscope, J * (skew(x) * biased.rotation_by_gyroscope - biased.displacement_by_gyroscope));
      if (blocks() == 4) rows.add(accelerometer, -J * image.displacement_by_bias);
      system->add(rows, seen.feature, J);
    }
    cost +=
        addPrior(state.gyroscope - options_.prior.mean.gyroscope, options_.prior.gyroscope_sigma, gyroscope, system);
    if (blocks() == 4 && std::isfinite(options_.prior.accelerometer_sigma)) {
      cost += addPrior(state.accelerometer, options_.prior.accelerometer_sigma, accelerometer, system);
    }
    if (system && options_.gravity) holdLength(state.gravity, gravity, *system);
    return cost;
  }

  const InertialWindow& window_;
  const InitialisationOptions& options_;
  ImuBias<double> base_;
  State state_, next_;
  std::vector<BearingObservation> observations_;
};

inline bool isUsable(const InitialisationOptions& o) {
  const GyroscopeBiasOptions& own = o.gyroscope_bias;
  return o.bearing_noise > 0 && o.prior.mean.gyroscope.allFinite() && o.prior.gyroscope_sigma > 0 &&
         std::isfinite(o.prior.gyroscope_sigma) && own.max_step > 0 && (!own.start || own.start->allFinite());
}

}  // namespace detail

/// The bias that explains the bearings best, with the closed form for it. The window is integrated anew where a
/// first-order update will not do.
inline GyroscopeBiasResult estimateGyroscopeBias(InertialWindow window, const InitialisationOptions& options) {
  GyroscopeBiasResult found;
  ClosedFormResult& result = found.result;
  const GyroscopeBiasOptions& own = options.gyroscope_bias;
  found.bias = own.start.value_or(options.prior.mean.gyroscope);
  result.fault = window.fault();
  if (!result.fault && !detail::isUsable(options)) result.fault = FaultKind::bad_option;
  if (!result.fault && window.size() == 0) result.fault = FaultKind::too_few_images;
  if (result.fault) return found;
  const ImuBias<double> base = window.bias();
  const auto closedForm = [&] {
    const ImuBias<double> bias{found.bias, base.accelerometer};
    found.integrations += window.integrateIfFar(bias);
    result = solveClosedForm(closedFormWindow(window, bias), options);
    return !result.fault;
  };
  if (!closedForm()) return found;
  if (result.window <= own.min_window && options.prior.gyroscope_sigma > own.sigma_from_rest) {
    found.status = FusionStatus::window_too_short;
    return found;
  }
  found.status = FusionStatus::not_converged;
  while (found.rounds < own.max_rounds) {
    if (!result.hasMotion()) {
      found.status = FusionStatus::no_start;
      return found;
    }
    detail::GyroscopeBiasProblem problem(window, options, result, found.bias, base);
    if (problem.features() == 0) {
      found.status = FusionStatus::no_start;
      return found;
    }
    detail::ReducedSystem system(problem.blocks(), problem.features());
    const detail::DampedSummary summary =
        detail::minimiseDamped(problem, system, {.max_iterations = own.max_iterations, .min_decrease = 1e-3});
    ++found.rounds;
    found.iterations += summary.iterations;
    found.cost = summary.cost;
    const Eigen::Vector3d change = problem.state().gyroscope - found.bias;
    found.bias = problem.state().gyroscope;
    const bool regular = system.factor(0);
    if (regular) {
      const std::vector<double> inverse = system.inverse({detail::GyroscopeBiasProblem::gyroscope});
      for (int i = 0; i < 9; ++i) found.covariance(i / 3, i % 3) = inverse[static_cast<std::size_t>(i)];
    }
    closedForm();
    // A tenth of a sigma is nothing.
    if (converged(summary.status) && regular && change.norm() <= 0.1 * std::sqrt(found.covariance.trace())) {
      found.status = FusionStatus::ok;
      break;
    }
  }
  return found;
}

}  // namespace liestat
