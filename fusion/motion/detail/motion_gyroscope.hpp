// Definitions of fusion/motion/gyroscope.hpp.
#pragma once

#include <fusion/detail/median.hpp>
#include <fusion/motion/gyroscope.hpp>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <utility>

namespace liestat {
namespace detail {

inline std::string secondsInWords(double seconds) {
  char text[64];
  std::snprintf(text, sizeof text, "%.6f", seconds);
  return text;
}

/// The median time between frames, each difference divided by that of the numbers.
inline double medianStep(const std::map<std::size_t, double>& times) {
  std::vector<double> steps;
  for (auto at = times.begin(), next = at; at != times.end() && ++next != times.end(); ++at) {
    steps.push_back((next->second - at->second) / static_cast<double>(next->first - at->first));
  }
  return median(std::move(steps));
}

inline std::string reasonOf(const Fault& fault, const GyroscopeReadings& readings, double begin, double end) {
  const std::vector<ImuSample<double>>& samples = readings.samples;
  const auto place = [&](std::size_t i) { return readings.place ? readings.place(i) : "reading " + std::to_string(i); };
  switch (fault.kind) {
    case FaultKind::gap:
      return "no reading from " + secondsInWords(samples[fault.index - 1].time) + " to " +
             secondsInWords(samples[fault.index].time) + " s (" + place(fault.index) + ")";
    case FaultKind::not_covered:
      return "it lasts from " + secondsInWords(begin) + " to " + secondsInWords(end) + " s, the readings from " +
             secondsInWords(samples.front().time) + " to " + secondsInWords(samples.back().time) + " s";
    case FaultKind::bad_interval:
      return "no time passes from " + secondsInWords(begin) + " to " + secondsInWords(end) + " s";
    default:
      return samples.empty() ? "there are no readings"
                             : "the reading in " + place(std::min(fault.index, samples.size() - 1)) + " is of no use";
  }
}

/// Steps of one frame, from frame k to the next by step(k), composed. Errors that are alike in all directions (`isotropic`)
/// are so after a turn.
template <class Step>
MotionGyroscope::Between overFrames(std::size_t first, std::size_t second, bool isotropic, const Step& step) {
  SO3d turned;
  GyroscopeRotation sum{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero()};
  for (std::size_t k = first; k < second; ++k) {
    MotionGyroscope::Between one = step(k);
    if (!one.rotation) return one;
    const SO3d turn = SO3d::exp(one.rotation->rotation);
    const Eigen::Matrix3d R = isotropic ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : turn.matrix();
    turned = turn * turned;
    sum.covariance = Eigen::Matrix3d(R * sum.covariance * R.transpose()) + one.rotation->covariance;
  }
  sum.rotation = turned.log();
  return {sum, {}};
}

}  // namespace detail

LIESTAT_FUSION_INLINE Gaussian<Eigen::Vector3d> MotionGyroscope::biasRate(
    const Gaussian<Eigen::Vector3d>& bias_per_frame) const {
  const Eigen::Matrix3d A = camera_R_sensor.matrix().transpose() / seconds;
  return {bias + gyroscopeBiasRate(bias_per_frame.mean, seconds, camera_R_sensor),
          A * bias_per_frame.covariance * A.transpose()};
}

LIESTAT_FUSION_INLINE MotionGyroscope gyroscopeOfRotations(std::vector<GyroscopeRotation> rotations, double seconds) {
  MotionGyroscope gyroscope;
  gyroscope.seconds = seconds;
  gyroscope.between = [list = std::make_shared<const std::vector<GyroscopeRotation>>(std::move(rotations))](
                          std::size_t first, std::size_t second) {
    return detail::overFrames(first, second, false, [&](std::size_t k) -> MotionGyroscope::Between {
      if (k + 1 < list->size() && (*list)[k + 1].rotation.allFinite() && (*list)[k + 1].covariance.allFinite()) {
        return {(*list)[k + 1], {}};
      }
      return {{}, "no rotation of frame " + std::to_string(k + 1)};
    });
  };
  return gyroscope;
}

LIESTAT_FUSION_INLINE MotionGyroscope gyroscopeOfRates(std::map<std::size_t, FrameRate> rates, double sigma,
                                                       const SO3d& camera_R_sensor, const Eigen::Vector3d& bias) {
  std::map<std::size_t, double> times;
  for (const auto& [frame, rate] : rates) times.emplace(frame, rate.time);
  MotionGyroscope gyroscope;
  gyroscope.camera_R_sensor = camera_R_sensor, gyroscope.bias = bias;
  gyroscope.seconds = detail::medianStep(times);
  gyroscope.between = [list = std::make_shared<const std::map<std::size_t, FrameRate>>(std::move(rates)), sigma,
                       camera_R_sensor, bias](std::size_t first, std::size_t second) {
    return detail::overFrames(first, second, true, [&](std::size_t k) -> MotionGyroscope::Between {
      const auto a = list->find(k), b = list->find(k + 1);
      if (a == list->end() || b == list->end()) {
        return {{}, "no rate at frame " + std::to_string(a == list->end() ? k : k + 1)};
      }
      const double seconds = b->second.time - a->second.time;
      if (!(seconds > 0)) return {{}, "no time passes from frame " + std::to_string(k) + " to the next"};
      const Eigen::Vector3d mean = 0.5 * (a->second.rate + b->second.rate) - bias;
      return {gyroscopeRotation(mean, seconds, sigma / seconds, camera_R_sensor), {}};
    });
  };
  return gyroscope;
}

LIESTAT_FUSION_INLINE MotionGyroscope gyroscopeOfReadings(GyroscopeReadings readings, const SO3d& camera_R_sensor) {
  MotionGyroscope gyroscope;
  gyroscope.camera_R_sensor = camera_R_sensor;
  gyroscope.bias = readings.how.preintegration.bias.gyroscope;
  gyroscope.bias_walk = readings.how.preintegration.noise.gyroscope_walk;
  gyroscope.seconds = detail::medianStep(readings.times);
  // The motions from frame to frame follow each other.
  double& rate = readings.how.preintegration.rate;
  if (!(rate > 0)) rate = readingRate<double>(readings.samples, readings.how.max_gap);
  readings.how.chained = true;
  gyroscope.between = [all = std::make_shared<const GyroscopeReadings>(std::move(readings)), camera_R_sensor](
                          std::size_t first, std::size_t second) -> MotionGyroscope::Between {
    const auto a = all->times.find(first), b = all->times.find(second);
    if (a == all->times.end() || b == all->times.end()) {
      return {{}, "frame " + std::to_string(a == all->times.end() ? first : second) + " has no time"};
    }
    const RecordingResult<double> result = preintegrate<double>(all->samples, a->second, b->second, all->how);
    if (!result.ok()) return {{}, detail::reasonOf(result.fault, *all, a->second, b->second)};
    return {gyroscopeRotation(result.motion, camera_R_sensor), {}};
  };
  return gyroscope;
}

LIESTAT_FUSION_INLINE std::string reasonWithoutCover(const MotionGyroscope& gyroscope,
                                                     const std::map<std::size_t, double>& times) {
  std::string why;
  for (auto at = times.begin(), next = at; at != times.end() && ++next != times.end(); ++at) {
    const MotionGyroscope::Between between = gyroscope.between(at->first, next->first);
    if (between.rotation) return {};
    if (why.empty()) why = "frame " + std::to_string(next->first) + ": " + between.why;
  }
  return why;
}

}  // namespace liestat
