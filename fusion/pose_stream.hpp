// A stream of poses with times: its poses between the stamps, its speeds, the error of interpolation, and the delay
// between two streams by their angular speeds.
#pragma once

#include <lie/se3.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace liestat {

struct TimedPose {
  double time = 0;  ///< s
  SE3d pose;
};

/// Poses in the order of their times. Between four stamps a pose is the cubic polynomial through the logarithms of
/// their motions from the second: accurate to the fourth order of the step, and as invariant as SE(3) itself.
class PoseStream {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  PoseStream() = default;
  /// Poses in any order; of several at one time the first one stays. Times are finite.
  explicit PoseStream(std::span<const TimedPose> poses) : poses_(poses.begin(), poses.end()) {
    std::stable_sort(poses_.begin(), poses_.end(), [](const auto& x, const auto& y) { return x.time < y.time; });
    const auto same = [](const TimedPose& x, const TimedPose& y) { return x.time == y.time; };
    poses_.erase(std::unique(poses_.begin(), poses_.end(), same), poses_.end());
    std::vector<double> gaps;
    for (std::size_t i = 1; i < poses_.size(); ++i) gaps.push_back(poses_[i].time - poses_[i - 1].time);
    if (gaps.empty()) return;
    std::nth_element(gaps.begin(), gaps.begin() + static_cast<std::ptrdiff_t>(gaps.size() / 2), gaps.end());
    step_ = gaps[gaps.size() / 2];
  }

  std::span<const TimedPose> poses() const { return poses_; }
  double step() const { return step_; }  ///< the median of the steps, s

  /// The pose at a time; nothing outside of the stream and in a gap of more than `max_steps` median steps.
  std::optional<SE3d> at(double time) const {
    constexpr double max_steps = 4;
    if (poses_.size() < 4 || !(time >= poses_.front().time && time <= poses_.back().time)) return std::nullopt;
    const auto next = std::upper_bound(poses_.begin() + 1, poses_.end() - 1, time,
                                       [](double t, const TimedPose& x) { return t < x.time; });
    const auto before = static_cast<std::size_t>(next - poses_.begin()) - 1;
    if (poses_[before + 1].time - poses_[before].time > max_steps * step_) return std::nullopt;
    const std::size_t first = std::min(before > 0 ? before - 1 : 0, poses_.size() - 4);
    return between({first, first + 1, first + 2, first + 3}, before, time);
  }
  /// The twist (m/s, rad/s, in the pose's frame) over ± `half` seconds.
  std::optional<Vector6> velocity(double time, double half = 0.05) const {
    const std::optional<SE3d> before = at(time - half), after = at(time + half);
    if (!before || !after) return std::nullopt;
    return (before->inverse() * *after).log() / (2 * half);
  }
  /// The mean square of the interpolation's error as a local error: with every second stamp left out it is that of
  /// twice the step, sixteen times as large as at the step itself. Zero for fewer than eight poses.
  Matrix6 interpolationError() const {
    Matrix6 sum = Matrix6::Zero();
    double n = 0;
    for (std::size_t i = 3; i + 3 < poses_.size(); ++i) {
      const Vector6 e = (poses_[i].pose.inverse() * between({i - 3, i - 1, i + 1, i + 3}, i - 1, poses_[i].time)).log();
      sum += e * e.transpose(), ++n;
    }
    constexpr double order = 16;
    return n > 1 ? Matrix6(sum / (n * order * order)) : Matrix6::Zero();
  }

 private:
  /// By the poses with these numbers at four different times, in the tangent space of the pose `base`.
  SE3d between(const std::array<std::size_t, 4>& nodes, std::size_t base, double time) const {
    Vector6 twist = Vector6::Zero();
    for (const std::size_t k : nodes) {
      double weight = 1;
      for (const std::size_t j : nodes) {
        if (j != k) weight *= (time - poses_[j].time) / (poses_[k].time - poses_[j].time);
      }
      if (k != base) twist += weight * (poses_[base].pose.inverse() * poses_[k].pose).log();
    }
    return poses_[base].pose * SE3d::exp(twist);
  }

  std::vector<TimedPose> poses_;
  double step_ = 0;
};

/// The delay within ± `largest` seconds for which angular speeds of b at t and of a at t + delay have the largest
/// correlation, to a half of b's step: a start, not an estimate. Zero where the streams do not overlap.
inline double delayOfSpeeds(const PoseStream& a, const PoseStream& b, double largest) {
  const double step = std::max(0.5 * b.step(), 1e-3 * largest);
  if (!(step > 0)) return 0;
  const auto speed = [](const PoseStream& stream, double time) -> std::optional<double> {
    const auto twist = stream.velocity(time);
    return twist ? std::optional(twist->tail<3>().norm()) : std::nullopt;
  };
  constexpr std::size_t max_times = 2000, min_times = 10;
  const std::size_t every = b.poses().size() / max_times + 1;
  std::vector<std::array<double, 2>> of_b;
  for (std::size_t i = 0; i < b.poses().size(); i += every) {
    if (const auto s = speed(b, b.poses()[i].time)) of_b.push_back({b.poses()[i].time, *s});
  }
  double best = 0, at = 0;
  const int steps = static_cast<int>(std::min(largest / step, 1e4));
  for (int k = -steps; k <= steps; ++k) {
    double n = 0, x = 0, y = 0, xx = 0, xy = 0, yy = 0;
    for (const auto& [time, s] : of_b) {
      const auto r = speed(a, time + k * step);
      if (!r) continue;
      ++n, x += *r, y += s, xx += *r * *r, xy += *r * s, yy += s * s;
    }
    if (n < min_times) continue;
    const double variance = (xx - x * x / n) * (yy - y * y / n);
    const double correlation = variance > 0 ? (xy - x * y / n) / std::sqrt(variance) : 0;
    if (correlation > best) best = correlation, at = k * step;
  }
  return at;
}

}  // namespace liestat
