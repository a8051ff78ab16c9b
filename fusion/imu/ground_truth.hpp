// The true states of a body at some times, with which estimates from its sensors are compared.
#pragma once

#include <fusion/imu/readings.hpp>
#include <lie/manifold.hpp>
#include <lie/se23.hpp>
#include <lie/so3.hpp>

#include <algorithm>
#include <optional>
#include <span>

namespace liestat {

/// The true state of a body, and the true biases of its sensor.
struct GroundTruth {
  double time = 0;  ///< s, since the start of the recording
  SE23d state;      ///< world_T_body with the velocity in the world
  ImuBias<double> bias;
};

/// The state at a time, between its two neighbours: linear, and along the geodesic of the rotations; the biases are
/// those of the one before. Empty outside of the rows and where these are more than 0.1 s apart. `truth` ascends in
/// time.
inline std::optional<GroundTruth> truthAt(std::span<const GroundTruth> truth, double time) {
  constexpr double max_gap = 0.1;  // s
  const auto next =
      std::lower_bound(truth.begin(), truth.end(), time, [](const GroundTruth& g, double t) { return g.time < t; });
  if (next == truth.end() || (next == truth.begin() && next->time > time)) return std::nullopt;
  if (next->time == time) return *next;
  const GroundTruth& before = *(next - 1);
  const double h = next->time - before.time;
  if (h > max_gap) return std::nullopt;
  const double s = (time - before.time) / h;
  GroundTruth at = before;
  at.time = time;
  at.state = SE23d(interpolate(SO3d(before.state.so3()), SO3d(next->state.so3()), s),
                   Eigen::Vector3d((1 - s) * before.state.translation() + s * next->state.translation()),
                   Eigen::Vector3d((1 - s) * before.state.velocity() + s * next->state.velocity()));
  return at;
}

}  // namespace liestat
