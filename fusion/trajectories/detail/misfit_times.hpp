// Definition of findTimeScale() (fusion/trajectory_misfit.hpp): a scale of the times by motion alone. Motions over
// equal spans of time, in the body's axes, know neither the world nor, but for a rotation and a short lever, the
// body's frame.
#pragma once

#include <fusion/pose_stream.hpp>
#include <fusion/trajectory_misfit.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace liestat::detail {

/// The estimate's time t is the reference's factor · t + zero; `agreement` is the correlation of the motions then, the
/// larger one of rotations and displacements, `of_both` the smaller one.
struct TimeScale {
  double factor = 1, zero = 0, agreement = 0, of_both = 0;
};

/// The agreement of a scale: the correlation of rotation vectors and of displacements over a lag, turned by the
/// rotation that makes each largest. The larger one, if the other does not contradict it and the rotations are as
/// large in both; zero if `least` of the shorter record is not common to both.
inline TimeScale agreed(const PoseStream& estimate, const PoseStream& reference, TimeScale s, double least = 0.6) {
  constexpr int points = 120, lags = 20;
  constexpr double contradicted = 0.3, alike = 2, of_positions = 5;
  s.agreement = 0;
  const double r0 = reference.poses().front().time, r1 = reference.poses().back().time,
               e0 = s.factor * estimate.poses().front().time + s.zero,
               e1 = s.factor * estimate.poses().back().time + s.zero, shorter = std::min(r1 - r0, e1 - e0),
               lag = shorter / lags, from = std::max(r0, e0), to = std::min(r1, e1);
  if (!(to - from > std::max(least * shorter, 2 * lag))) return s;
  std::array<Eigen::Matrix3d, 2> M{Eigen::Matrix3d::Zero(), Eigen::Matrix3d::Zero()};
  std::array<Eigen::Vector3d, 2> a{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()}, b = a;
  std::array<double, 2> aa{0, 0}, bb{0, 0};
  double n = 0;
  for (int k = 0; k < points; ++k) {
    const double t = from + (to - from - lag) * k / (points - 1);
    const auto before = estimate.at((t - s.zero) / s.factor), after = estimate.at((t + lag - s.zero) / s.factor),
               first = reference.at(t), last = reference.at(t + lag);
    if (!before || !after || !first || !last) continue;
    const SE3d x = before->inverse() * *after, y = first->inverse() * *last;
    const std::array<Eigen::Vector3d, 2> u{Eigen::Vector3d(x.so3().log()), Eigen::Vector3d(x.translation())},
        v{Eigen::Vector3d(y.so3().log()), Eigen::Vector3d(y.translation())};
    for (std::size_t i = 0; i < 2; ++i) {
      M[i] += v[i] * u[i].transpose(), a[i] += u[i], b[i] += v[i];
      aa[i] += u[i].squaredNorm(), bb[i] += v[i].squaredNorm();
    }
    ++n;
  }
  if (2 * n < points) return s;
  s.of_both = 1;
  for (std::size_t i = 0; i < 2; ++i) {
    const double size = std::sqrt(aa[i] / bb[i]), limit = i == 0 ? alike : of_positions;
    M[i] -= b[i] * a[i].transpose() / n;
    const double variance = (aa[i] - a[i].squaredNorm() / n) * (bb[i] - b[i].squaredNorm() / n);
    // A motion that stays the same has no variance but that of rounding.
    if (!(variance > 1e-12 * aa[i] * bb[i])) continue;
    const double correlation = SO3d::fitToSO3(M[i]).matrix().cwiseProduct(M[i]).sum() / std::sqrt(variance);
    s.agreement = std::max(s.agreement, correlation);
    s.of_both = std::min(s.of_both, size > 1 / limit && size < limit ? correlation : 0);
  }
  if (s.of_both < contradicted) s.agreement = 0;
  return s;
}

}  // namespace liestat::detail

namespace liestat {

LIESTAT_FUSION_INLINE MisfitSearch findTimeScale(const PoseStream& estimate, const PoseStream& reference,
                                                 double offset) {
  using detail::TimeScale;
  constexpr std::size_t least_poses = 20;
  constexpr double named = 0.9, of_speed = 0.8, better = 0.25;
  MisfitSearch result;
  result.reason = "fewer than 20 poses with times";
  const auto e = estimate.poses(), r = reference.poses();
  if (std::min(e.size(), r.size()) < least_poses) return result;
  result.searched = true, result.reason.clear(), result.poses = e.size();
  const auto at = [&](double factor, double zero, double least = 0.6) {
    return detail::agreed(estimate, reference, {factor, zero, 0, 0}, least);
  };
  const double as_is = at(1, offset, 0).agreement;
  // Only zeros of the clocks that a file can have: the same one, or the beginnings of both.
  const auto zeros = [&](double factor) { return std::array{0., offset, r.front().time - factor * e.front().time}; };
  TimeScale best;
  const auto take = [&](const TimeScale& s, double least = 0) {
    if (s.of_both >= least && s.agreement > best.agreement) best = s;
  };
  for (const double unit : {1e-3, 1e-6, 1e-9, 1e3, 1e6, 1e9}) {
    for (const double zero : zeros(unit)) take(at(unit, zero));
  }
  // Another speed is told only where both have times in common: two runs of one course may differ by as much. Many are
  // tried, so that rotations and displacements both have to agree.
  const double e_span = e.back().time - e.front().time, r_span = r.back().time - r.front().time;
  const double common =
      std::min(e.back().time + offset, r.back().time) - std::max(e.front().time + offset, r.front().time);
  if (best.agreement < named && common > 0.1 * std::min(e_span, r_span)) {
    constexpr int steps = 40;
    for (int k = -steps; k <= steps; ++k) {
      const double factor = r_span / e_span * std::exp(0.01 * k);
      for (const double zero : zeros(factor)) take(at(factor, zero), of_speed);
    }
    const bool aligned = best.zero != 0 && best.zero != offset;
    for (double step = 0.005; step > 1e-4; step *= 0.5) {
      const double factor = best.factor;
      for (const double f : {factor * (1 - step), factor * (1 + step)}) {
        take(at(f, aligned ? zeros(f)[2] : best.zero), of_speed);
      }
    }
  }
  if (best.agreement < named || 1 - best.agreement > better * (1 - as_is)) return result;
  MisfitExplanation x;
  x.faults = {Misfit::time_scale}, x.time_factor = best.factor, x.delay = x.offset = best.zero;
  x.explained = best.agreement * best.agreement;
  result.explanations.push_back(x);
  return result;
}

}  // namespace liestat
