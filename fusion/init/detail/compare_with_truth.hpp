#pragma once

#include <fusion/visual_inertial_truth.hpp>

#include <cmath>
#include <utility>
#include <vector>

namespace liestat {
namespace detail {

/// The angle between two directions.
inline double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// The NEES of V and G, and of each by itself; G on its sphere.
inline void setNees(ComparedWindow& w, const Eigen::Vector3d& V, const Eigen::Vector3d& G) {
  const RefinementResult& refined = *w.refined;
  Eigen::Matrix<double, 6, 1> error;
  error << refined.velocity() - V, refined.gravity - G;
  const Eigen::Matrix<double, 6, 6> covariance = refined.covariance.atFirst().template topLeftCorner<6, 6>();
  w.nees = neesOnSphere<5>(error, covariance, refined.gravity);
  w.velocity_nees = mahalanobisSquared<double, 3>(Eigen::Vector3d(error.head<3>()),
                                                  Eigen::Matrix3d(covariance.topLeftCorner<3, 3>()));
  Eigen::Matrix<double, 2, 3> across;
  across.row(0) = refined.gravity.unitOrthogonal();
  across.row(1) = refined.gravity.normalized().cross(across.row(0).transpose());
  w.gravity_nees = mahalanobisSquared<double, 2>(
      Eigen::Vector2d(across * error.tail<3>()),
      Eigen::Matrix2d(across * covariance.bottomRightCorner<3, 3>() * across.transpose()));
}

inline void compare(ComparedWindow& w, std::span<const GroundTruth> all, std::optional<double> gravity) {
  if (w.fault || w.image_times.empty()) return;
  std::vector<GroundTruth> truth;
  for (const double time : w.image_times) {
    const std::optional<GroundTruth> at = truthAt(all, time);
    if (!at) return;
    truth.push_back(*at);
  }
  const SO3d back = SO3d(truth[0].state.so3()).inverse();
  const Eigen::Vector3d V = back * Eigen::Vector3d(truth[0].state.velocity());
  const Eigen::Vector3d G = back * Eigen::Vector3d(0, 0, -gravity.value_or(9.81));
  const auto errorOf = [&](const Eigen::Vector3d& velocity, const Eigen::Vector3d& found,
                           const std::vector<SE23d>& states) {
    double both = 0, own = 0;
    for (std::size_t j = 0; j < states.size(); ++j) {
      const Eigen::Vector3d p = back * Eigen::Vector3d(truth[j].state.translation() - truth[0].state.translation());
      both += p.dot(states[j].translation());
      own += p.squaredNorm();
    }
    return InitialisationError{(velocity - V).norm(), angleBetween(found, G), both / own - 1};
  };
  if (!w.closedForm().solutions.empty()) {
    const ClosedFormSolution& s = w.closedForm().solutions[0];
    w.closed_form_error = errorOf(s.velocity, s.gravity, w.closedFormStates());
  }
  w.gyroscope_error = (w.bias().gyroscope - truth[0].bias.gyroscope).norm();
  if (!w.isRefined()) return;
  w.refined_error = errorOf(w.refined->velocity(), w.refined->gravity, w.refined->states);
  if (gravity && w.closedForm().status != FusionStatus::stationary) setNees(w, V, G);
}

/// The fields that say what was found.
inline void setState(ComparedStretch& stretch) {
  const auto& [down, velocity, gyroscope, resting_force] = stretch.state.mean.parts();
  const auto accelerometer = accelerometerBias(stretch.state, stretch.gravity);
  stretch.down = down.unit_vector();
  stretch.velocity = velocity;
  stretch.gyroscope_bias = gyroscope;
  stretch.accelerometer_bias = accelerometer.mean;
  const auto sigma = [&](int first, int n) {
    return std::sqrt(stretch.state.covariance.diagonal().segment(first, n).mean());
  };
  stretch.down_sigma = sigma(0, 2);
  stretch.velocity_sigma = sigma(2, 3);
  stretch.gyroscope_sigma = sigma(5, 3);
  stretch.accelerometer_sigma = std::sqrt(accelerometer.covariance.diagonal().mean());
}

inline void compare(ComparedStretch& stretch, const GroundTruth& truth) {
  const SO3d back = SO3d(truth.state.so3()).inverse();
  const Eigen::Vector3d down = back * Eigen::Vector3d(0, 0, -1);
  const InertialState state(S2d(down), Eigen::Vector3d(back * Eigen::Vector3d(truth.state.velocity())),
                            truth.bias.gyroscope, Eigen::Vector3d(truth.bias.accelerometer - stretch.gravity * down));
  stretch.gravity_error = distance(stretch.state.mean.get<0>(), state.get<0>());
  stretch.speed_error = (stretch.velocity - state.get<1>()).norm();
  stretch.gyroscope_error = (stretch.gyroscope_bias - truth.bias.gyroscope).norm();
  stretch.accelerometer_error = (stretch.accelerometer_bias - truth.bias.accelerometer).norm();
  stretch.nees = mahalanobisSquared(stretch.state, state);
}

}  // namespace detail

LIESTAT_FUSION_INLINE ComparedRecording compareWithTruth(VisualInertialResult found,
                                                         std::span<const double> image_times,
                                                         std::span<const GroundTruth> truth,
                                                         std::optional<double> gravity) {
  ComparedRecording result;
  result.gravity = gravity;
  result.noise_calibration = found.noise_calibration;
  result.filter_start = found.filter_start;
  result.bearing_noise = found.bearing_noise;
  result.images_outside = found.images_outside;
  result.windows_left = found.windows_left;
  for (InitialisedWindow& window : found.windows) {
    ComparedWindow& w = result.windows.emplace_back();
    static_cast<InitialisedWindow&>(w) = std::move(window);
    for (const std::size_t j : w.images) w.image_times.push_back(image_times[j]);
    w.track_names.assign(w.tracks.begin(), w.tracks.end());
    detail::compare(w, truth, gravity);
  }
  for (FusedStretch& stretch : found.stretches) {
    ComparedStretch& f = result.stretches.emplace_back();
    static_cast<FusedStretch&>(f) = std::move(stretch);
    if (!f.has_state) continue;
    detail::setState(f);
    if (const auto at = truthAt(truth, f.end)) detail::compare(f, *at);
  }
  return result;
}

}  // namespace liestat
