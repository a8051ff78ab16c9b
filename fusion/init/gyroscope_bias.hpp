// The gyroscope's bias out of a window: the closed form is not robust to it (0.05 rad/s cost a sixth of the scale and
// two degrees of gravity over two seconds), and has no linear unknown for it.
//
//   const auto found = liestat::estimateGyroscopeBias(window, {.closed_form = {.bearing_noise = 1. / 450}});
//   if (found.ok()) … found.bias, found.covariance, found.result.solutions[0]
//
// The outer problem over the bias of the design note, section 3.6: the bearings' angles as a function of the bias, with
// velocity, gravity and features the best for each, by damped Gauss-Newton with these eliminated. Angles of predicted
// directions are minimised, not the linear system's residuals: those shrink with the scene, and a large bias that lets
// depths collapse makes them small. Each round begins at the closed form for the bias that the last one found.
#pragma once

#include <fusion/init/closed_form.hpp>
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

struct GyroscopeBiasOptions {
  ClosedFormOptions closed_form = {};               ///< bearing_noise must be given
  Eigen::Vector3d prior = Eigen::Vector3d::Zero();  ///< rad/s
  double prior_deviation = 0.1;                     ///< rad/s
  std::optional<Eigen::Vector3d> start = {};        ///< rad/s, where to begin; none: at the prior
  double largest_step = 0.2;                        ///< rad/s
  /// A window of at most so many seconds is only solved with a prior as good as one from rest.
  double least_window = 1;
  double deviation_from_rest = 0.02;  ///< rad/s
  int most_rounds = 8;                ///< each from the closed form for the last one's bias
  int most_iterations = 20;           ///< in a round
};

enum class GyroscopeBiasStatus {
  ok,
  not_converged,     ///< the rounds ended before the bias stayed
  no_closed_form,    ///< no solution with features in front to begin with: see result.status
  window_too_short,  ///< and no prior from rest
  bad_input          ///< see result.fault
};

/// In words, for people.
inline const char* describe(GyroscopeBiasStatus status) {
  switch (status) {
    case GyroscopeBiasStatus::ok:
      return "the gyroscope's bias was found";
    case GyroscopeBiasStatus::not_converged:
      return "the search for the gyroscope's bias did not converge";
    case GyroscopeBiasStatus::no_closed_form:
      return "no solution with features in front of the camera to estimate the gyroscope's bias from";
    case GyroscopeBiasStatus::window_too_short:
      return "the window is too short to estimate the gyroscope's bias without a prior from rest";
    case GyroscopeBiasStatus::bad_input:
      return "bad input";
  }
  return "";
}

struct GyroscopeBiasResult {
  GyroscopeBiasStatus status = GyroscopeBiasStatus::bad_input;
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();  ///< rad/s, whole: not the change of the one that was integrated
  /// From image noise and the prior; without the inertial sensor's noise.
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  ClosedFormResult result;  ///< for this bias
  double cost = 0;          ///< Σ (angle/noise)² and the priors
  int rounds = 0, iterations = 0;
  int integrations = 0;  ///< how often the readings were integrated anew

  bool ok() const { return status == GyroscopeBiasStatus::ok && result.ok(); }
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
  GyroscopeBiasProblem(const InertialWindow& window, const GyroscopeBiasOptions& options, const ClosedFormResult& start,
                       const Eigen::Vector3d& bias, const ImuBias<double>& base)
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
        const Eigen::Vector3d bearing = seen.bearing.normalized();
        observations_.push_back({state_.P.size() - 1, seen.image, bearing, tangentRows(bearing), seen.deviation});
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
    if (!(turn.norm() <= options_.largest_step)) return std::numeric_limits<double>::infinity();
    next_.velocity += system.shared(velocity);
    next_.gravity += system.shared(gravity);
    if (options_.closed_form.gravity) next_.gravity *= *options_.closed_form.gravity / next_.gravity.norm();
    next_.gyroscope += turn;
    if (blocks() == 4) next_.accelerometer += system.shared(accelerometer);
    for (std::size_t i = 0; i < next_.P.size(); ++i) next_.P[i] += system.feature(i);
    setImages(next_);
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

  void setImages(State& state) const {
    state.images = biasedImages(window_.motions, {state.gyroscope, base_.accelerometer + state.accelerometer});
  }
  /// From image j, in t0's axes, without the lever arm.
  static Eigen::Vector3d fromImage(const State& state, const WindowImage& image, const Eigen::Vector3d& P) {
    const double t = image.time;
    return P - t * state.velocity - (0.5 * t * t) * state.gravity - image.displacement;
  }
  bool isInFront(const FeatureTrack& track, const Eigen::Vector3d& P) const {
    for (const TrackedBearing& seen : track) {
      const WindowImage& image = state_.images[seen.image].image;
      const Eigen::Vector3d d = image.rotation.transpose() * fromImage(state_, image, P) - window_.camera;
      if (!(d.dot(seen.bearing) > 0)) return false;
    }
    return true;
  }
  static void addPrior(const Eigen::Vector3d& error, double deviation, int block, ReducedSystem* system, double& cost) {
    ResidualRows rows(3);
    rows.add(block, Eigen::Matrix3d(Eigen::Matrix3d::Identity() / deviation));
    for (int k = 0; k < 3; ++k) rows.value[static_cast<std::size_t>(k)] = error[k] / deviation;
    cost += rows.squared();
    if (system) system->add(rows);
  }

  /// The cost, infinite where a feature is behind its camera; and derivatives, if asked for.
  double run(const State& state, ReducedSystem* system) const {
    double cost = 0;
    const double sigma = options_.closed_form.bearing_noise;
    Eigen::Matrix<double, 2, 3> by_d;
    for (const Observation& seen : observations_) {
      const BiasedImage& biased = state.images[seen.image];
      const WindowImage& image = biased.image;
      const Eigen::Vector3d x = fromImage(state, image, state.P[seen.feature]);
      const Eigen::Vector3d d = image.rotation.transpose() * x - window_.camera;
      ResidualRows rows(2);
      if (!bearingResidual(d, seen.across, seen.bearing, seen.deviation * sigma, rows, by_d)) {
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
    addPrior(state.gyroscope - options_.prior, options_.prior_deviation, gyroscope, system, cost);
    if (blocks() == 4 && std::isfinite(options_.closed_form.bias_deviation)) {
      addPrior(state.accelerometer, options_.closed_form.bias_deviation, accelerometer, system, cost);
    }
    if (system && options_.closed_form.gravity) {
      // A stiff row along G: its length has no freedom.
      ResidualRows rows(1);
      rows.value[0] = 0;
      rows.add(gravity, Eigen::Matrix<double, 1, 3>(1e6 * state.gravity.normalized().transpose()));
      system->add(rows);
    }
    return cost;
  }

  const InertialWindow& window_;
  const GyroscopeBiasOptions& options_;
  ImuBias<double> base_;
  State state_, next_;
  std::vector<Observation> observations_;
};

inline bool isUsable(const GyroscopeBiasOptions& o) {
  return o.closed_form.bearing_noise > 0 && o.prior.allFinite() && o.prior_deviation > 0 &&
         std::isfinite(o.prior_deviation) && o.largest_step > 0 && (!o.start || o.start->allFinite());
}

}  // namespace detail

/// The bias that explains the bearings best, with the closed form for it. `integrate(bias)` integrates the readings of
/// the window anew: it returns motions as in InertialWindow, and is called where a first-order update will not do.
template <class Integrate>
GyroscopeBiasResult estimateGyroscopeBias(InertialWindow window, const GyroscopeBiasOptions& options,
                                          const Integrate& integrate) {
  GyroscopeBiasResult found;
  ClosedFormResult& result = found.result;
  found.bias = options.start.value_or(options.prior);
  if (!detail::isUsable(options)) result.fault = ClosedFormFault::bad_option;
  if (result.fault == ClosedFormFault::none && window.motions.empty()) result.fault = ClosedFormFault::too_few_images;
  if (result.fault != ClosedFormFault::none) return found;
  ImuBias<double> base = window.motions[0].options().bias;
  const auto update = [&] {
    const ImuBias<double> bias{found.bias, base.accelerometer};
    const auto far = [&](const Preintegration<double>& motion) { return motion.mustReintegrate(bias); };
    if (std::none_of(window.motions.begin(), window.motions.end(), far)) return;
    std::vector<Preintegration<double>> motions = integrate(bias);
    if (motions.size() != window.motions.size()) return;  // as good as it gets
    window.motions = std::move(motions);
    ++found.integrations;
  };
  const auto closedForm = [&] {
    update();
    result = solveClosedForm(closedFormWindow(window, {found.bias, base.accelerometer}), options.closed_form);
    return result.fault == ClosedFormFault::none;
  };
  if (!closedForm()) return found;
  if (result.window <= options.least_window && options.prior_deviation > options.deviation_from_rest) {
    found.status = GyroscopeBiasStatus::window_too_short;
    return found;
  }
  found.status = GyroscopeBiasStatus::not_converged;
  while (found.rounds < options.most_rounds) {
    if (result.solutions.empty() || result.status == ClosedFormStatus::stationary ||
        result.status == ClosedFormStatus::scale_unobservable) {
      found.status = GyroscopeBiasStatus::no_closed_form;
      return found;
    }
    detail::GyroscopeBiasProblem problem(window, options, result, found.bias, base);
    if (problem.features() == 0) {
      found.status = GyroscopeBiasStatus::no_closed_form;
      return found;
    }
    detail::ReducedSystem system(problem.blocks(), problem.features());
    const detail::DampedSummary summary = detail::minimiseDamped(problem, system, options.most_iterations, 1e-3);
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
    // A tenth of a deviation is nothing.
    if (summary.converged && regular && change.norm() <= 0.1 * std::sqrt(found.covariance.trace())) {
      found.status = GyroscopeBiasStatus::ok;
      break;
    }
  }
  return found;
}

/// The same without readings: motions are updated to first order, whatever the change.
inline GyroscopeBiasResult estimateGyroscopeBias(const InertialWindow& window,
                                                 const GyroscopeBiasOptions& options = {}) {
  return estimateGyroscopeBias(window, options,
                               [](const ImuBias<double>&) { return std::vector<Preintegration<double>>(); });
}

}  // namespace liestat
