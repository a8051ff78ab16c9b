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
#include <utility>
#include <vector>

namespace liestat {

struct TimedPose {
  double time = 0;  ///< s
  SE3d pose;
};

/// The curve between two poses of a stream.
enum class PoseInterpolation {
  geodesic,  ///< the screw motion T₀ Exp(s Log(T₀⁻¹ T₁))
  slerp,     ///< straight line of the position, SLERP of the rotation
  cubic      ///< through the two poses and their neighbours; geodesic in a gap far longer than the steps beside it
};
constexpr auto words(PoseInterpolation) { return std::array{"geodesic", "slerp", "cubic"}; }

namespace detail {

/// The curve through poses of ascending times, and its error, measured without a truth: with every second stamp left
/// out, the stamps that are left out show the error of twice the step. Source: size(), time(i), pose(i).
template <class Source>
class PoseCurve {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  /// Poses that a pose depends on, of which the first `count` are meant.
  struct Nodes {
    std::array<std::size_t, 4> at{};
    std::size_t count = 0;
  };

  PoseCurve(Source source, PoseInterpolation rule) : source_(source), rule_(rule) {}

  /// The nodes of a time between the stamps `before` and `before` + 1.
  Nodes nodes(std::size_t before) const {
    constexpr double max_steps = 4;  // beyond, the noise of the neighbours' speed would be carried far into the gap
    const Nodes two{{before, before + 1}, 2};
    if (rule_ != PoseInterpolation::cubic || source_.size() < 4) return two;
    const std::size_t first = std::min(before > 0 ? before - 1 : 0, source_.size() - 4);
    const double gap = source_.time(before + 1) - source_.time(before);
    for (std::size_t k = first; k < first + 3; ++k) {
      if (gap > max_steps * (source_.time(k + 1) - source_.time(k))) return two;
    }
    return {{first, first + 1, first + 2, first + 3}, 4};
  }
  SE3d at(std::size_t before, double time) const { return between(nodes(before), before, time); }

  /// The pose at a time by the polynomial through the logarithms of the nodes' motions from the pose `base`.
  SE3d between(const Nodes& nodes, std::size_t base, double time) const {
    const SE3d from = source_.pose(base);
    if (rule_ == PoseInterpolation::slerp) {
      const SE3d to = source_.pose(nodes.at[1]);
      const double s = (time - source_.time(base)) / (source_.time(nodes.at[1]) - source_.time(base));
      return SE3d(from.so3() * SO3d::exp(s * (from.so3().inverse() * to.so3()).log()),
                  Eigen::Vector3d((1 - s) * from.translation() + s * to.translation()));
    }
    Vector6 twist = Vector6::Zero();
    for (std::size_t k = 0; k < nodes.count; ++k) {
      if (nodes.at[k] == base) continue;
      double weight = 1;
      for (std::size_t j = 0; j < nodes.count; ++j) {
        if (j == k) continue;
        const double t = source_.time(nodes.at[j]);
        weight *= (time - t) / (source_.time(nodes.at[k]) - t);
      }
      twist += weight * (from.inverse() * source_.pose(nodes.at[k])).log();
    }
    return from * SE3d::exp(twist);
  }

  /// Π (t - t_k) over the nodes: to leading order the error at t is a derivative of the motion times this.
  double polynomial(const Nodes& nodes, double time) const {
    double product = 1;
    for (std::size_t k = 0; k < nodes.count; ++k) product *= time - source_.time(nodes.at[k]);
    return product;
  }
  /// Pose i by the stamps that are left if every second of every `stride`-th is left out: i ± stride, i ± 3 stride.
  /// Nothing near the ends.
  std::optional<Nodes> leftOut(std::size_t i, std::size_t count, std::size_t stride) const {
    const std::size_t reach = (count - 1) * stride;
    if (i < reach || i + reach >= source_.size()) return std::nullopt;
    if (count == 2) return Nodes{{i - stride, i + stride}, 2};
    return Nodes{{i - 3 * stride, i - stride, i + stride, i + 3 * stride}, 4};
  }
  /// The error of pose i by those nodes, in its own axes.
  Vector6 error(std::size_t i, const Nodes& nodes) const {
    const std::size_t base = nodes.at[nodes.count / 2 - 1];
    return (source_.pose(i).inverse() * between(nodes, base, source_.time(i))).log();
  }
  /// The factor by which errors at the step itself are larger than those of twice the step divided by 4 (two nodes) or
  /// 16 (four): halving the step gains that much in slow motion only, so no more is taken than halving twice the step
  /// has shown. Of positions (from 0) or rotations (from 3).
  double lostGain(std::size_t count, int from) const {
    double fine = 0, coarse = 0;
    const std::size_t every = source_.size() / 1000 + 1;
    for (std::size_t i = 0; i < source_.size(); i += every) {
      const auto near = leftOut(i, count, 1), far = leftOut(i, count, 2);
      if (!far) continue;
      fine += error(i, *near).template segment<3>(from).squaredNorm();
      coarse += error(i, *far).template segment<3>(from).squaredNorm();
    }
    const double promised = count == 2 ? 4 : 16;
    return fine > 0 ? promised / std::clamp(std::sqrt(coarse / fine), 1., promised) : 1;
  }

 private:
  Source source_;
  PoseInterpolation rule_;
};

}  // namespace detail

/// Poses in the order of their times. Between four stamps a pose is the cubic polynomial through the logarithms of
/// their motions from the second: accurate to the fourth order of the step, and as invariant as SE(3) itself.
class PoseStream {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using Matrix6 = Eigen::Matrix<double, 6, 6>;

  PoseStream() = default;
  /// Poses in any order; of several at one time the first one stays. Times are finite.
  explicit PoseStream(std::vector<TimedPose> poses) : poses_(std::move(poses)) {
    const auto earlier = [](const auto& x, const auto& y) { return x.time < y.time; };
    if (!std::is_sorted(poses_.begin(), poses_.end(), earlier)) std::stable_sort(poses_.begin(), poses_.end(), earlier);
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
    return curve().between({{first, first + 1, first + 2, first + 3}, 4}, before, time);
  }
  /// The twist (m/s, rad/s, in the pose's frame) over ± `half` seconds.
  std::optional<Vector6> velocity(double time, double half = 0.05) const {
    const std::optional<SE3d> before = at(time - half), after = at(time + half);
    if (!before || !after) return std::nullopt;
    return (before->inverse() * *after).log() / (2 * half);
  }
  /// The mean square of the interpolation's error as a local error: with every second stamp left out it is that of
  /// twice the step, up to sixteen times as large as at the step itself. Zero for fewer than eight poses.
  Matrix6 interpolationError() const {
    Matrix6 sum = Matrix6::Zero();
    double n = 0;
    for (std::size_t i = 3; i + 3 < poses_.size(); ++i) {
      const Vector6 e = curve().error(i, *curve().leftOut(i, 4, 1));
      sum += e * e.transpose(), ++n;
    }
    if (n < 2) return Matrix6::Zero();
    constexpr double order = 16;
    Vector6 gain;
    gain << Eigen::Vector3d::Constant(curve().lostGain(4, 0) / order),
        Eigen::Vector3d::Constant(curve().lostGain(4, 3) / order);
    return gain.asDiagonal() * sum * gain.asDiagonal() / n;
  }

 private:
  struct Source {
    std::span<const TimedPose> poses;

    std::size_t size() const { return poses.size(); }
    double time(std::size_t i) const { return poses[i].time; }
    const SE3d& pose(std::size_t i) const { return poses[i].pose; }
  };
  detail::PoseCurve<Source> curve() const { return {{poses_}, PoseInterpolation::cubic}; }

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
