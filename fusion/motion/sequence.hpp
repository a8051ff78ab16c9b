// The motion of a camera through all frames of some tracks in one call: pairs, filter and gyroscope as the options say.
//
//   liestat::MotionResult result = liestat::estimateMotion(frames, {.frames_apart = 4});
//   std::cout << result.verdict().text;
//   for (const liestat::MotionFrame& frame : result.frames) … frame.motion …
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/motion/gyroscope.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <fusion/motion/results.hpp>
#include <fusion/motion/track_pairs.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <functional>
#include <map>
#include <vector>

namespace liestat {

/// The observations of each frame, by the frames' numbers. Frames between the first and the last that are missing have
/// none.
using TrackFrames = std::map<std::size_t, std::vector<TrackObservation>>;

/// Called after each frame with its number, its result and the filter.
using MotionObserver = std::function<void(const MotionFrame&, const MotionFilter&)>;

/// Runs the filter of the options over a sequence, `passes` times; the result is that of the last pass. Results are per
/// frame whatever the interval of the pairs. A combination of options that no filter serves gives a result with a fault
/// and without frames; frames of which nothing can be said have flags (MotionFlags).
LIESTAT_FUSION_API MotionResult estimateMotion(const TrackFrames& frames, const MotionOptions& options = {},
                                               const MotionGyroscope& gyroscope = {},
                                               const MotionObserver& observer = {});

/// The true pose of a camera.
struct TrueCamera {
  Eigen::Matrix3d R_camera_world = Eigen::Matrix3d::Identity();  ///< takes world to camera coordinates
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();              ///< in the world, m
};

/// Sets the errors of the frames whose true pose, and that at the start of their interval, are known: of the rotation
/// per frame, and of the direction, against the velocity or the translation as the estimate means it, where the camera
/// moved by more than `min_motion` (m).
LIESTAT_FUSION_API void compareWithTruth(MotionResult& result, const std::map<std::size_t, TrueCamera>& truth,
                                         double min_motion = 0.1);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/motion/detail/motion_sequence.hpp>
#endif
