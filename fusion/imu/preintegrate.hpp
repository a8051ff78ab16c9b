// Preintegration of a recording between any two times: readings with irregular time stamps, gaps, interpolation at both
// ends, three schemes (docs/theory/visual_inertial.md, sections 2.1 and 2.3).
#pragma once

#include <fusion/imu/detail/scheme_error.hpp>
#include <fusion/imu/preintegration.hpp>
#include <fusion/imu/reading_rate.hpp>
#include <fusion/status.hpp>
#include <stats/maha.hpp>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <vector>

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
  /// The interval is one of several that follow each other and are taken for independent. Two intervals share the
  /// readings at their common end: by itself each has the variance of what it uses of them; one after the other each
  /// has half of the variance of both together.
  bool chained = false;
};

/// Verdict of the times and the changes of readings on an increment, the worst first.
enum class ImuSampling {
  adequate,
  untested,  ///< too few readings to see how rate and force vary within a step
  rough,     ///< readings differ from their neighbours by more than their noise: vibration, or wrong times or densities
  undersampled,  ///< rate and force vary so much between readings that the estimate of the scheme's error may be off
  bunched        ///< readings come in bunches: their times may be those of arrival
};

/// "adequate", "untested", …
inline const char* nameOf(ImuSampling sampling) {
  constexpr const char* names[] = {"adequate", "untested", "rough", "undersampled", "bunched"};
  return names[static_cast<int>(sampling)];
}

/// The result of preintegrate(). Only one without fault is to be used.
template <class S>
struct RecordingResult {
  Preintegration<S> motion;
  Fault fault;       ///< the first of the readings that were used, with the reading's index
  S max_gap = S(0);  ///< s, between readings that were used, up to the fault
  S rate = S(0);     ///< Hz, that the variance of a reading was taken from: stated, or measured
  ImuSampling sampling = ImuSampling::adequate;
  /// Squared length of the scheme's estimated error in standard deviations of the sensor's noise. The error is in the
  /// covariance as one more standard deviation along its direction. NaN without noise.
  S scheme_error = S(0);

  bool ok() const { return !fault; }
};

namespace detail {

/// The reading `k`, less the bias.
template <class S>
ImuReading<S> unbiased(const ImuSample<S>& s, const ImuBias<S>& bias) {
  return {s.angular_rate - bias.gyroscope, s.specific_force - bias.accelerometer};
}

/// Readings beside a step [k, k+1] that are at least half a step away from it, so that a polynomial through four does
/// not magnify their noise: four of one bunch have differences that are noise alone.
template <class S>
struct ImuNeighbours {
  static constexpr std::size_t reach = 16;

  std::size_t before, after;
  bool has_before = false, has_after = false;

  /// Neither looks beyond readings that do not ascend, have a gap or are not finite, nor further than `reach` readings.
  ImuNeighbours(std::span<const ImuSample<S>> samples, std::size_t k, const S& max_gap) : before(k), after(k + 1) {
    const S half = S(0.5) * (samples[k + 1].time - samples[k].time);
    const auto follows = [&](std::size_t i, std::size_t outer) {
      const S step = samples[i].time - samples[i - 1].time;
      return step > S(0) && step <= max_gap && samples[outer].angular_rate.allFinite() &&
             samples[outer].specific_force.allFinite();
    };
    while (!has_before && before > 0 && k - before < reach && follows(before, before - 1)) {
      has_before = samples[k].time - samples[--before].time >= half;
    }
    while (!has_after && after + 1 < samples.size() && after - k <= reach && follows(after + 1, after + 1)) {
      has_after = samples[++after].time - samples[k + 1].time >= half;
    }
  }
};

/// Lagrange's polynomial through up to four readings: both of a step and those beside it.
template <class S>
class ImuInterpolant {
 public:
  ImuInterpolant(std::span<const ImuSample<S>> samples, std::size_t k, const ImuNeighbours<S>* beside)
      : samples_(samples), nodes_{k, k + 1} {
    if (beside != nullptr && beside->has_before) nodes_[n_++] = beside->before;
    if (beside != nullptr && beside->has_after) nodes_[n_++] = beside->after;
  }
  ImuReading<S> operator()(const S& time) const {
    ImuReading<S> r;
    for (std::size_t i = 0; i < n_; ++i) {
      const S w = weight(i, time);
      r.rate += w * samples_[nodes_[i]].angular_rate;
      r.force += w * samples_[nodes_[i]].specific_force;
    }
    return r;
  }
  /// Calls visit(reading, weight) with the weights of the integral over h seconds from `from`.
  template <class Visit>
  void integral(const S& from, const S& h, const Visit& visit) const {
    const S offset = h / (S(2) * std::sqrt(S(3))), middle = from + S(0.5) * h;  // Gauss' points
    for (std::size_t i = 0; i < n_; ++i) {
      visit(nodes_[i], S(0.5) * h * (weight(i, middle - offset) + weight(i, middle + offset)));
    }
  }

 private:
  S weight(std::size_t i, const S& time) const {
    S weight(1);
    for (std::size_t j = 0; j < n_; ++j) {
      const S at = samples_[nodes_[j]].time;
      if (j != i) weight *= (time - at) / (samples_[nodes_[i]].time - at);
    }
    return weight;
  }

  std::span<const ImuSample<S>> samples_;
  std::size_t nodes_[4] = {}, n_ = 2;
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

/// Periods that a held reading's step lasts, of which the reading itself covers one: more than one where readings are
/// missing, which clocks that jitter are not taken for.
template <class S>
S heldPeriods(const S& step, const S& rate) {
  using std::floor;
  using std::max;
  constexpr double jitter = 0.7;
  return max(S(1), S(floor(step * rate + S(1 - jitter))));
}

/// Seconds of white noise over a part [from, to] of the step between readings k and k+1, density² times which is its
/// variance. Two steps share the reading between them, and each has half of what they have in common, so that the sum
/// over an interval is right: Σ c W over a step's readings, c (s) the weight that the step gives a reading and W that
/// of all.
template <class S>
S averagedNoiseTime(std::span<const ImuSample<S>> samples, std::size_t k, const S& begin, const S& end, bool chained,
                    const S& rate) {
  // The weights that the part of a step within the interval gives the readings at its ends.
  const auto weights = [&](std::size_t i, S& first, S& second) {
    const S at = samples[i].time, whole = samples[i + 1].time - at;
    const S from = std::max(begin, at), to = std::min(end, samples[i + 1].time), h = to - from;
    second = h * (S(0.5) * (from + to) - at) / whole, first = h - second;
    return whole;
  };
  S first, second, other;
  const S whole = weights(k, first, second);
  S total_first = first, total_second = second;
  const bool follows = samples[k].time > begin, goes_on = samples[k + 1].time < end && k + 2 < samples.size();
  if (chained) {
    total_first = S(0.5) * (whole + (follows ? samples[k].time - samples[k - 1].time : whole));
    total_second = S(0.5) * (whole + (goes_on ? samples[k + 2].time - samples[k + 1].time : whole));
  } else {
    S ignored;
    if (follows) weights(k - 1, ignored, other), total_first += other;
    if (goes_on) weights(k + 1, other, ignored), total_second += other;
  }
  return rate * (first * total_first + second * total_second);
}

/// The same for cubics through four readings, whose weights reach beyond a step.
template <class S>
class CubicNoiseTime {
 public:
  /// For an interval whose first reading is `first` and whose last is before `last`.
  CubicNoiseTime(std::span<const ImuSample<S>> samples, std::size_t first, std::size_t last, const S& begin,
                 const S& end, const RecordingOptions<S>& options, const S& rate)
      : samples_(samples), rate_(rate), base_(first - std::min(first, margin)) {
    total_.assign(last - base_ + margin, S(0));
    // The steps beside the interval have their weights where it is one of several.
    const std::size_t more = options.chained ? std::min<std::size_t>(first, 2) : 0;
    const std::size_t stop = std::min(last + (options.chained ? 2 : 0), samples.size());
    for (std::size_t k = first - more; k + 1 < stop; ++k) {
      const S step = samples[k + 1].time - samples[k].time;
      if (!(step > S(0) && step <= options.max_gap)) continue;
      const S from = options.chained ? samples[k].time : std::max(begin, samples[k].time);
      const S to = options.chained ? samples[k + 1].time : std::min(end, samples[k + 1].time);
      const ImuNeighbours<S> beside(samples, k, options.max_gap);
      ImuInterpolant<S>(samples, k, &beside).integral(from, to - from, [&](std::size_t i, const S& weight) {
        if (i >= base_ && i - base_ < total_.size()) total_[i - base_] += weight;
      });
    }
  }
  S operator()(const ImuInterpolant<S>& at, const S& from, const S& h) const {
    S sum(0);
    at.integral(from, h, [&](std::size_t i, const S& weight) { sum += weight * total_[i - base_]; });
    // Weights of outer readings are negative, and may outweigh the others' where steps are very unequal.
    constexpr double share = 0.1;
    return std::max(rate_ * sum, S(share) * h);
  }

 private:
  static constexpr std::size_t margin = ImuNeighbours<S>::reach + 4;

  std::span<const ImuSample<S>> samples_;
  S rate_;
  std::size_t base_;
  std::vector<S> total_;
};

/// Those of a reading that is the mean over a step of `whole` seconds, of which the interval has h. A step as long as
/// several periods lacks readings, and its own covers one of them.
template <class S>
S heldNoiseTime(const S& h, const S& whole, bool chained, const S& rate) {
  const S periods = heldPeriods(whole, rate);
  return chained ? h * periods : h * periods * (h / whole);
}

/// Follows the error of a scheme through an interval, and says at its end what is known of it.
template <class S>
class SchemeWatch {
 public:
  SchemeWatch(std::span<const ImuSample<S>> samples, const RecordingOptions<S>& options, const S& rate)
      : samples_(samples), options_(options), rate_(rate) {}

  /// The step [from, to] between readings k and k+1, by which the increment came from `before` to `after`.
  void step(std::size_t k, const S& from, const S& to, const ImuNeighbours<S>& beside, const SE23<S>& before,
            const SE23<S>& after) {
    const ImuSample<S>&one = samples_[k], &two = samples_[k + 1];
    const S h = to - from, whole = two.time - one.time, x = from - one.time, y = to - one.time;
    const ImuBias<S>& bias = options_.preintegration.bias;
    ++steps_;
    // Clocks jitter by less than nine tenths of a period.
    constexpr double in_a_bunch = 0.1;
    if (whole * rate_ < S(in_a_bunch)) ++bunched_;
    if (!beside.has_before && !beside.has_after) ++untested_;
    ImuReading<S> first, last, curved;
    const ImuReading<S> a = unbiased(one, bias), b = unbiased(two, bias);
    const ImuReading<S> slope = (b - a) * (S(1) / whole), bend = curvature(k, beside, slope);
    if (options_.scheme == ImuScheme::held) {
      const ImuReading<S> between_means = heldSlope(k, beside);
      const S middle = heldMiddle(k);
      first = a + between_means * (x - middle), last = a + between_means * (y - middle);
      curved = between_means * (h * (S(0.5) * (x + y) - middle));
    } else {
      first = a + slope * x, last = a + slope * y;
      curved = bend * (y * y * (y / S(3) - whole / S(2)) - x * x * (x / S(3) - whole / S(2)));
    }
    error_.advance(h, before, after, SchemeError<S>::ofStep(h, first, last, curved));
    SchemeError<S> next;
    const Bend now{S(0.5) * (one.time + two.time), whole, bend, quartic(k, beside),
                   beside.has_before && beside.has_after};
    const bool three = bends_ >= 2 && now.full && last_.full && before_last_.full && last_.at < now.at;
    if (three) {
      // Half of the second derivative of the second derivative's half is six fourth divided differences.
      const ImuReading<S> change = ((now.bend - last_.bend) * (S(1) / (now.at - last_.at)) -
                                    (last_.bend - before_last_.bend) * (S(1) / (last_.at - before_last_.at))) *
                                   (S(1) / (now.at - before_last_.at));
      next.rotation = (last_.quartic / S(6)) * change.rate;
      next.velocity = (last_.quartic / S(6)) * change.force;
      constexpr double even = 1.5;
      if (std::max({now.step, last_.step, before_last_.step}) <
          S(even) * std::min({now.step, last_.step, before_last_.step})) {
        // In even steps the difference of noise is (1, -3, 2, 2, -3, 1)/(8 h⁴) times six readings.
        const S scale = S(8) * last_.step * last_.step * last_.step * last_.step;
        rough_rate_ += scale * scale * change.rate.squaredNorm();
        rough_force_ += scale * scale * change.force.squaredNorm();
        ++rough_;
      }
    }
    before_last_ = last_, last_ = now, ++bends_;
    if (options_.scheme == ImuScheme::cubic) next_.advance(h, before, after, next);
  }

  void conclude(RecordingResult<S>& result) const {
    const ImuNoise<S>& noise = options_.preintegration.noise;
    const bool has_noise = noise.gyroscope > S(0) && noise.accelerometer > S(0);
    const SE23<S>& increment = result.motion.increment();
    const auto squaredLength = [&](const SchemeError<S>& error) {
      const SO3<S> back = SO3<S>(increment.so3()).inverse();
      Eigen::Matrix<S, 9, 1> e;
      e << back * error.position, back * error.rotation, back * error.velocity;
      return mahalanobisSquared<S, 9>(e, result.motion.gaussian().covariance);
    };
    result.scheme_error = has_noise ? squaredLength(error_) : std::numeric_limits<S>::quiet_NaN();
    bool undersampled = result.scheme_error > S(max_scheme_error);
    SchemeError<S> error = error_;
    if (options_.scheme == ImuScheme::cubic) {
      // The error of the cubic scheme is less than that of the averaged one. Its estimate need not be: fourth
      // differences over unequal steps are mostly noise.
      const S fourth = has_noise ? squaredLength(next_) : result.scheme_error;
      if (!(fourth > result.scheme_error)) error = next_, result.scheme_error = fourth;
      undersampled = result.scheme_error > S(max_cubic_error);
    }
    if (has_noise) result.motion.addError(error.position, error.rotation, error.velocity);
    const auto isRough = [&](const S& sum, const S& density) {
      const S variance = S(28) * rate_ * density * density;  // of the six readings' difference
      return rough_ >= min_rough && sum > S(3. * max_roughness * static_cast<double>(rough_)) * variance;
    };
    if (10 * bunched_ > steps_) {
      result.sampling = ImuSampling::bunched;
    } else if (undersampled) {
      result.sampling = ImuSampling::undersampled;
    } else if (has_noise && (isRough(rough_rate_, noise.gyroscope) || isRough(rough_force_, noise.accelerometer))) {
      result.sampling = ImuSampling::rough;
    } else if (untested_ == steps_) {
      result.sampling = ImuSampling::untested;
    }
  }

 private:
  /// Half of the second derivative within the step: two second divided differences, of the step with one neighbour
  /// each, weighted as the integral of the cubic through all four is.
  ImuReading<S> curvature(std::size_t k, const ImuNeighbours<S>& beside, const ImuReading<S>& slope) const {
    const S h = samples_[k + 1].time - samples_[k].time;
    ImuReading<S> left, right;
    S a(0), c(0);
    if (beside.has_before) {
      a = samples_[k].time - samples_[beside.before].time;
      left = (slope - between(beside.before, k) * (S(1) / a)) * (S(1) / (h + a));
    }
    if (beside.has_after) {
      c = samples_[beside.after].time - samples_[k + 1].time;
      right = (between(k + 1, beside.after) * (S(1) / c) - slope) * (S(1) / (h + c));
    }
    if (!beside.has_before) return right;
    if (!beside.has_after) return left;
    const S weight = (a + S(0.5) * h) / (a + h + c);
    return left * (S(1) - weight) + right * weight;
  }
  ImuReading<S> between(std::size_t i, std::size_t j) const {
    return {samples_[j].angular_rate - samples_[i].angular_rate,
            samples_[j].specific_force - samples_[i].specific_force};
  }
  /// The middle of what a held reading is the mean over, since its time.
  S heldMiddle(std::size_t k) const {
    const S whole = k + 1 < samples_.size() ? samples_[k + 1].time - samples_[k].time : S(1) / rate_;
    return S(0.5) * whole / heldPeriods(whole, rate_);
  }
  ImuReading<S> heldSlope(std::size_t k, const ImuNeighbours<S>& beside) const {
    const std::size_t i = beside.has_before ? beside.before : k, j = k + 1;
    return between(i, j) * (S(1) / (samples_[j].time + heldMiddle(j) - samples_[i].time - heldMiddle(i)));
  }

  /// ∫ s (s - h)(s + a)(s - h - c) ds over the step, the error of its cubic over the fourth divided difference.
  S quartic(std::size_t k, const ImuNeighbours<S>& beside) const {
    const S h = samples_[k + 1].time - samples_[k].time;
    const S a = samples_[k].time - samples_[beside.before].time, c = samples_[beside.after].time - samples_[k + 1].time;
    const S h3 = h * h * h;
    return h3 * (-h * h / S(20) - (a - h - c) * h / S(12) + a * (h + c) / S(6));
  }

  /// Half of a second derivative, and the step that it was found in.
  struct Bend {
    S at = S(0), step = S(0);
    ImuReading<S> bend;
    S quartic = S(0);
    bool full = false;
  };

  /// Squared lengths in standard deviations up to which the estimate of a scheme's error was found to hold
  /// (docs/preintegration.md): that of the next even order to some 5 %, that of the cubic scheme to its size.
  static constexpr double max_scheme_error = 100, max_cubic_error = 1;
  /// Variance of readings against their neighbours over that of their noise, and how often it must be seen.
  static constexpr double max_roughness = 4;
  static constexpr std::size_t min_rough = 10;

  std::span<const ImuSample<S>> samples_;
  const RecordingOptions<S>& options_;
  S rate_;
  SchemeError<S> error_, next_;  ///< of the scheme; of the cubic one
  Bend last_, before_last_;
  S rough_rate_ = S(0), rough_force_ = S(0);
  std::size_t steps_ = 0, bunched_ = 0, untested_ = 0, bends_ = 0, rough_ = 0;
};

}  // namespace detail

/// The motion from time `begin` to `end` (s) out of readings in the order of time. The readings may be those of a whole
/// recording: the interval's are found by bisection, and only they are checked, with the one next to them at each end
/// that the cubic scheme needs. Readings beside the interval serve the estimate of the scheme's error where they have
/// no fault. Where times do not ascend the result is a fault, or that of readings which do ascend from `begin` to
/// `end`.
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
  const bool cubic = options.scheme == ImuScheme::cubic;
  // The cubic scheme needs one reading more at each end.
  const std::size_t more = cubic ? 1 : 0, foremost = k - std::min(k, more);
  result.rate = options.preintegration.rate;
  std::optional<detail::CubicNoiseTime<S>> cubic_noise;
  if (cubic || !(result.rate > S(0))) {
    std::size_t last = k + 1;
    while (last < samples.size() && samples[last - 1].time < end) ++last;
    if (!(result.rate > S(0))) result.rate = readingRate<S>(samples.subspan(k, last - k), options.max_gap);
    if (cubic) cubic_noise.emplace(samples, k, last, begin, end, options, result.rate);
  }
  detail::SchemeWatch<S> watch(samples, options, result.rate);
  std::size_t checked = foremost;
  for (; k + 1 < samples.size() && samples[k].time < end; ++k) {
    for (; checked < std::min(k + 2 + more, samples.size()); ++checked) {
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
    const SE23<S> before = result.motion.increment();
    const detail::ImuNeighbours<S> beside(samples, k, options.max_gap);
    const detail::ImuInterpolant<S> at(samples, k, cubic ? &beside : nullptr);
    const S noise_time =
        held    ? detail::heldNoiseTime<S>(h, samples[k + 1].time - samples[k].time, options.chained, result.rate)
        : cubic ? (*cubic_noise)(at, from, h)
                : detail::averagedNoiseTime<S>(samples, k, begin, end, options.chained, result.rate);
    if (held) {
      result.motion.add(h, samples[k].angular_rate, samples[k].specific_force, noise_time);
    } else if (!cubic) {
      const detail::ImuReading<S> mean = at(S(0.5) * (from + to));
      result.motion.add(h, mean.rate, mean.force, noise_time);
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
      result.motion.addVarying(h, at(middle).force, whole, position, velocity, noise_time);
    }
    watch.step(k, from, to, beside, before, result.motion.increment());
  }
  // The last reading was beyond the end, and is not where times do not ascend.
  if (samples[k].time < end) return fault(FaultKind::not_covered, k);
  watch.conclude(result);
  return result;
}

}  // namespace liestat
