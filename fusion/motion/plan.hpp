// Planning of recursive motion from its options: the filter and its settings for an input, or the reason why there is
// none. The rules are here so that the class, the function over a sequence, the program and Python follow the same
// ones.
//
//   const liestat::MotionPlan plan = liestat::planOf({.frames_apart = 4});   // the subspace filter, midpoint flow
//   if (plan.ok()) liestat::MotionFilter filter(plan);                        // fusion/motion/motion_filter.hpp
#pragma once

#include <fusion/motion/types.hpp>

#include <array>
#include <cstddef>
#include <string_view>

namespace liestat {

/// The flow that is asked for.
enum class FlowChoice {
  automatic,  ///< midpoint, with a gyroscope discrete
  forward,
  midpoint,
  discrete
};
/// The filter that is asked for.
enum class FilterChoice {
  automatic,    ///< the composition for pairs of successive frames, else the subspace filter
  composition,  ///< the subspace filter until it has settled, then the essential filter
  subspace,
  essential
};
/// Their words, in the order of the enumerators.
inline constexpr std::array<std::string_view, 4> flow_choices{"automatic", "forward", "midpoint", "discrete"};
inline constexpr std::array<std::string_view, 4> filter_choices{"automatic", "composition", "subspace", "essential"};

/// Options of a run over tracks. The numbers are those of MotionFilterOptions.
struct MotionOptions {
  FlowChoice flow = FlowChoice::automatic;
  FilterChoice filter = FilterChoice::automatic;
  /// Frames between the positions of a pair, at most: more than one for noise that drowns the motion of one frame.
  /// Results are per frame all the same.
  std::size_t frames_apart = 1;
  std::size_t starts = MotionFilterOptions{}.starts;             ///< directions to start from
  double process_noise = MotionFilterOptions{}.process_noise;    ///< rad² per frame, of the direction
  double rotation_noise = MotionFilterOptions{}.rotation_noise;  ///< rad² per frame, of the rotation
  bool outliers = false;                                         ///< expect wrong tracks
  bool bias = false;                                             ///< the gyroscope's bias is a state
  double bias_sigma = 0.02;                                      ///< rad/s, at the start
  std::size_t passes = 1;  ///< times that a sequence is run through, each from the end of the one before
};

/// Why there is no plan for some options.
enum class MotionFault {
  none,
  composition_over_intervals,  ///< the composition for pairs over several frames
  bias_without_gyroscope,      ///< the bias of a gyroscope that is not there
  no_time                      ///< a bias in rad/s, and no time passes between frames
};

/// The fault in words: what is wrong, without what to do about it.
constexpr const char* inWords(MotionFault fault) {
  switch (fault) {
    case MotionFault::composition_over_intervals:
      return "the composition takes successive frames";
    case MotionFault::bias_without_gyroscope:
      return "a bias is that of a gyroscope, and there is none";
    case MotionFault::no_time:
      return "no time passes between frames";
    case MotionFault::none:
      break;
  }
  return "";
}

/// The time base of a gyroscope, which turns a bias in rad/s into one per frame.
struct GyroscopeClock {
  bool given = false;    ///< there is a gyroscope
  double seconds = 0;    ///< between two frames
  double bias_walk = 0;  ///< rad/s/√s: density of the random walk of its bias
};

/// How a MotionFilter runs.
struct MotionPlan {
  FilterChoice filter = FilterChoice::composition;  ///< never automatic
  MotionFilterOptions settings;                     ///< settings of the filters; a bias of the gyroscope is per step
  std::size_t frames_apart = 1;
  /// The filter takes an interval as one step of time, and pairs of that interval alone: the epipolar constraint
  /// (discrete flow, essential filter) knows no other. Otherwise pairs of all intervals go together.
  bool whole_intervals = false;
  double step_seconds = 0;  ///< duration of the filter's unit of time, where there is a gyroscope
  MotionFault fault = MotionFault::none;

  bool ok() const { return fault == MotionFault::none; }
};

/// The plan for some options. One with a fault says so, and is not to be run.
inline MotionPlan planOf(const MotionOptions& options, const GyroscopeClock& gyroscope = {}) {
  MotionPlan plan;
  plan.frames_apart = options.frames_apart > 0 ? options.frames_apart : 1;
  plan.filter = options.filter;
  if (plan.filter == FilterChoice::automatic) {
    plan.filter = plan.frames_apart > 1 ? FilterChoice::subspace : FilterChoice::composition;
  }
  if (plan.filter == FilterChoice::composition && plan.frames_apart > 1) {
    plan.fault = MotionFault::composition_over_intervals;
  }
  MotionFilterOptions& settings = plan.settings;
  switch (options.flow) {
    case FlowChoice::automatic:
      settings.flow = gyroscope.given ? Flow::discrete : Flow::midpoint;
      break;
    case FlowChoice::forward:
      settings.flow = Flow::forward;
      break;
    case FlowChoice::midpoint:
      settings.flow = Flow::midpoint;
      break;
    case FlowChoice::discrete:
      settings.flow = Flow::discrete;
      break;
  }
  plan.whole_intervals = settings.flow == Flow::discrete || plan.filter == FilterChoice::essential;
  settings.starts = options.starts, settings.outliers = options.outliers;
  settings.process_noise = options.process_noise, settings.rotation_noise = options.rotation_noise;
  plan.step_seconds = gyroscope.seconds * static_cast<double>(plan.whole_intervals ? plan.frames_apart : 1);
  if (!options.bias || !plan.ok()) return plan;
  if (!gyroscope.given) {
    plan.fault = MotionFault::bias_without_gyroscope;
  } else if (!(plan.step_seconds > 0)) {
    plan.fault = MotionFault::no_time;
  }
  settings.estimate_bias = true;
  settings.bias_sigma = options.bias_sigma * plan.step_seconds;
  const double walk = gyroscope.bias_walk * plan.step_seconds;
  settings.bias_noise = walk * walk * gyroscope.seconds;
  return plan;
}

/// The motion over an interval of so many frames as that of one frame: rotation, gyroscope's bias, inverse depths. The
/// direction, and what it means, stay.
inline MotionEstimate perFrame(MotionEstimate motion, std::size_t frames) {
  const auto n = static_cast<double>(frames);
  const Eigen::Vector3d omega = motion.rotation.mean.log(), one = omega / n;
  const Eigen::Matrix3d J = SO3d::rightJacobian(one) * SO3d::rightJacobianInverse(omega) / n;
  motion.rotation.mean = SO3d::exp(one);
  motion.rotation.covariance = J * motion.rotation.covariance * J.transpose();
  motion.gyroscope_bias.mean /= n, motion.gyroscope_bias.covariance /= n * n;
  motion.mean_inverse_depth /= n, motion.mean_inverse_depth_variance /= n * n;
  return motion;
}

}  // namespace liestat
