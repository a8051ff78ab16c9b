// Preintegration of a recording between any two times: readings with irregular time stamps, gaps, interpolation at both
// ends, three schemes (docs/theory/visual_inertial.md, sections 2.1 and 2.3).
#pragma once

#include <fusion/imu/preintegration.hpp>
#include <fusion/status.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

namespace liestat {

/// How motion goes on between readings, and thereby what a reading stands for.
enum class ImuScheme {
  averaged,  ///< instantaneous readings; the mean of two neighbours holds between them, integrated exactly. Order 2
  held,      ///< a reading is the mean rate and force from its time to the next (delta-angle sensors)
  cubic  ///< instantaneous readings; a cubic through four, Magnus' and Simpson's rules. Order 3 to 4; for exact data
         ///< and slow sensors, because it amplifies vibration
};

/// How a recording is integrated.
template <class S>
struct RecordingOptions {
  PreintegrationOptions<S> preintegration = {};
  ImuScheme scheme = ImuScheme::averaged;
  S max_gap = S(0.1);  ///< s; readings further apart than this make the result not usable
};

/// The result of preintegrate(). Only one without fault is to be used.
template <class S>
struct RecordingResult {
  Preintegration<S> motion;
  Fault fault;       ///< the first of the readings that were used, with the reading's index
  S max_gap = S(0);  ///< s, between readings that were used, up to the fault

  bool ok() const { return !fault; }
};

namespace detail {

/// Rate and force at a time.
template <class S>
struct ImuReading {
  Eigen::Matrix<S, 3, 1> rate, force;
};

/// Lagrange's polynomial through up to four readings around [k, k+1].
template <class S>
class ImuInterpolant {
 public:
  ImuInterpolant(std::span<const ImuSample<S>> samples, std::size_t k, std::size_t points) : samples_(samples) {
    const std::size_t before = (points - 2) / 2;
    first_ = k > before ? k - before : 0;
    last_ = std::min(first_ + points, samples.size());
    first_ = last_ > points ? last_ - points : 0;
  }
  /// The readings that it uses.
  std::size_t first() const { return first_; }
  std::size_t end() const { return last_; }
  ImuReading<S> operator()(const S& time) const {
    ImuReading<S> r{Eigen::Matrix<S, 3, 1>::Zero(), Eigen::Matrix<S, 3, 1>::Zero()};
    for (std::size_t i = first_; i < last_; ++i) {
      S weight(1);
      for (std::size_t j = first_; j < last_; ++j) {
        if (j != i) weight *= (time - samples_[j].time) / (samples_[i].time - samples_[j].time);
      }
      r.rate += weight * samples_[i].angular_rate;
      r.force += weight * samples_[i].specific_force;
    }
    return r;
  }

 private:
  std::span<const ImuSample<S>> samples_;
  std::size_t first_ = 0, last_ = 0;
};

/// Rotation vector over h seconds from a rate that varies, by Magnus' expansion to fourth order with Gauss' two points:
/// the mean, and the commutator of the rates, which turns as the body does (R' = R [ω]).
template <class S, class Rate>
Eigen::Matrix<S, 3, 1> magnusRotation(const Rate& rate, const S& begin, const S& h) {
  const S root = std::sqrt(S(3));
  const Eigen::Matrix<S, 3, 1> a = rate(begin + h * (S(0.5) - root / S(6))),
                               b = rate(begin + h * (S(0.5) + root / S(6)));
  return S(0.5) * h * (a + b) + (root / S(12) * h * h) * a.cross(b);
}

}  // namespace detail

/// The motion from time `begin` to `end` (s) out of readings in the order of time. The readings may be those of a whole
/// recording: the interval's are found by bisection, and only they are looked at and checked, with the one next to them
/// at each end that the cubic scheme needs. Where times do not ascend the result is a fault, or that of readings which
/// do ascend from `begin` to `end`.
template <class S>
RecordingResult<S> preintegrate(std::span<const ImuSample<S>> samples, const S& begin, const S& end,
                                const RecordingOptions<S>& options = {}) {
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  RecordingResult<S> result{Preintegration<S>(options.preintegration), {}, S(0)};
  const auto fault = [&result](FaultKind what, std::size_t at) {
    result.fault = {what, at};
    return result;
  };
  // Written so that NaN is a fault too.
  if (!(end > begin) || !std::isfinite(end - begin)) return fault(FaultKind::bad_interval, 0);
  if (samples.size() < 2 || samples.front().time > begin) return fault(FaultKind::not_covered, 0);
  if (samples.back().time < end) return fault(FaultKind::not_covered, samples.size() - 1);

  // The last reading at or before the beginning: bisection ends between one that is and one that is not, in any order.
  const auto after = std::partition_point(samples.begin(), samples.end(),
                                          [&](const ImuSample<S>& sample) { return sample.time <= begin; });
  // Only a time that is not a number is neither after the beginning nor at or before it.
  if (after == samples.begin()) return fault(FaultKind::not_finite, 0);
  std::size_t k = static_cast<std::size_t>(after - samples.begin()) - 1;
  const bool held = options.scheme == ImuScheme::held;
  const std::size_t points = options.scheme == ImuScheme::cubic ? 4 : 2;
  const std::size_t foremost = detail::ImuInterpolant<S>(samples, k, points).first();
  std::size_t checked = foremost;
  for (; k + 1 < samples.size() && samples[k].time < end; ++k) {
    const detail::ImuInterpolant<S> at(samples, k, points);
    for (; checked < at.end(); ++checked) {
      const ImuSample<S>& s = samples[checked];
      if (!std::isfinite(s.time) || !s.angular_rate.allFinite() || !s.specific_force.allFinite()) {
        return fault(FaultKind::not_finite, checked);
      }
      if (checked == foremost) continue;
      const S gap = s.time - samples[checked - 1].time;
      if (!(gap > S(0))) return fault(FaultKind::not_ascending, checked);
      result.max_gap = std::max(result.max_gap, gap);
      if (gap > options.max_gap) return fault(FaultKind::gap, checked);
    }
    const S from = std::max(begin, samples[k].time), to = std::min(end, samples[k + 1].time), h = to - from;
    if (!(h > S(0))) continue;
    if (held) {
      result.motion.add(h, samples[k].angular_rate, samples[k].specific_force);
    } else if (options.scheme == ImuScheme::averaged) {
      const detail::ImuReading<S> mean = at(S(0.5) * (from + to));
      result.motion.add(h, mean.rate, mean.force);
    } else {
      const ImuBias<S>& bias = options.preintegration.bias;
      const auto rate = [&](const S& time) { return Vector3(at(time).rate - bias.gyroscope); };
      const S middle = S(0.5) * (from + to);
      const Vector3 half = detail::magnusRotation<S>(rate, from, S(0.5) * h),
                    whole = detail::magnusRotation<S>(rate, from, h);
      const Vector3 first = at(from).force - bias.accelerometer;
      const Vector3 second = SO3<S>::exp(half) * Vector3(at(middle).force - bias.accelerometer);
      const Vector3 third = SO3<S>::exp(whole) * Vector3(at(to).force - bias.accelerometer);
      // Simpson's rule for the integral of the force and for that of (h - s) times it.
      const Vector3 velocity = (h / S(6)) * (first + S(4) * second + third);
      const Vector3 position = (h * h / S(6)) * (first + S(2) * second);
      result.motion.addVarying(h, at(middle).force, whole, position, velocity);
    }
  }
  // The last reading was beyond the end, and is not where times do not ascend.
  if (samples[k].time < end) return fault(FaultKind::not_covered, k);
  return result;
}

}  // namespace liestat
