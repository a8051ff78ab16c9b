// Definitions of fusion/motion/sequence.hpp.
#pragma once

#include <fusion/motion/results.hpp>
#include <fusion/motion/sequence.hpp>
#include <lie/manifold.hpp>

#include <algorithm>
#include <span>

namespace liestat {

LIESTAT_FUSION_INLINE MotionResult estimateMotion(const TrackFrames& frames, const MotionOptions& options,
                                                  const MotionGyroscope& gyroscope, const MotionObserver& observer) {
  const MotionPlan plan = planOf(options, gyroscope.clock());
  MotionResult result;
  result.fault = plan.fault, result.settings = plan.settings;
  result.passes = std::max<std::size_t>(options.passes, 1), result.frames_apart = plan.frames_apart;
  result.with_gyroscope = gyroscope.given(), result.with_bias = options.bias;
  if (!plan.ok() || frames.empty()) return result;
  result.first_frame = frames.begin()->first;
  MotionFilter filter(plan);
  for (std::size_t pass = 0; pass < result.passes; ++pass) {
    filter.beginSequence();
    result.frames.clear();
    for (std::size_t k = result.first_frame; k <= frames.rbegin()->first; ++k) {
      const auto at = frames.find(k);
      MotionFrame frame;
      frame.frame = k;
      MotionGyroscope::Between between;
      if (gyroscope.given() && k > result.first_frame) between = gyroscope.between(k - filter.interval(), k);
      frame.no_gyroscope = between.why;
      filter.updateOver(at == frames.end() ? std::span<const TrackObservation>{} : std::span(at->second),
                        between.rotation);
      if (k == result.first_frame) continue;
      frame.motion = filter.estimate();
      frame.essential = filter.essential_in_charge();
      frame.covariance_judged = frame.motion.covariance_judged() && result.passes == 1;
      if (options.bias) frame.gyroscope_bias = gyroscope.biasRate(frame.motion.gyroscope_bias);
      if (observer) observer(frame, filter);
      result.frames.push_back(frame);
    }
  }
  result.hand_overs = filter.hand_overs(), result.fall_backs = filter.fall_backs();
  return result;
}

LIESTAT_FUSION_INLINE void compareWithTruth(MotionResult& result, const std::map<std::size_t, TrueCamera>& truth,
                                            double min_motion) {
  result.with_truth = true;
  for (MotionFrame& frame : result.frames) {
    frame.with_truth = true;
    const std::size_t apart = std::min(result.frames_apart, frame.frame - result.first_frame);
    const auto first = truth.find(frame.frame - apart), second = truth.find(frame.frame);
    if (first == truth.end() || second == truth.end()) continue;
    const Eigen::Matrix3d& R_2 = second->second.R_camera_world;
    const SO3d R = SO3d::fitToSO3(Eigen::Matrix3d(R_2 * first->second.R_camera_world.transpose()));
    const Eigen::Vector3d T = R_2 * (first->second.centre - second->second.centre);
    const auto n = static_cast<double>(apart);
    const Eigen::Vector3d turn = n * frame.motion.rotation.mean.log();
    frame.rotation_error = distance(SO3d::exp(turn), R) / n;
    // The velocity that is constant over the interval, T = J_l(Ω) V, by the true rotation: that of a noisy frame says
    // little.
    const Eigen::Vector3d V = SO3d::leftJacobianInverse(R.log()) * T;
    frame.truth = TrueMotion{R.log() / n, V / n};
    if (!(T.norm() > min_motion)) continue;
    const bool velocity = frame.motion.meaning == DirectionMeaning::velocity;
    frame.direction_error = distance(frame.motion.direction.mean, S2d(velocity ? V : T));
  }
}

}  // namespace liestat
