// The angles of bearings as a function of motion, gravity and biases; see fusion/init/gyroscope_bias.hpp.
#pragma once

#include <fusion/init/detail/bearing_rows.hpp>
#include <fusion/init/detail/reduced_system.hpp>
#include <fusion/imu/window.hpp>
#include <fusion/init/closed_form_types.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

namespace liestat::detail {

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

}  // namespace liestat::detail
