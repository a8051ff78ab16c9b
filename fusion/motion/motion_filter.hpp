// The filter to use where nothing else is asked for: frames of tracks in, the motion of one frame out. For pairs of
// successive frames it is the subspace filter until it has settled on one direction, then the essential filter beside
// it, and back to the former when the rotation turns out to change; for pairs over several frames the subspace filter.
//
//   liestat::MotionFilter filter;                                      // or filter(planOf({.frames_apart = 4}))
//   for (…) if (filter.update(observations).ok()) … filter.estimate()  // or update(observations, gyroscope)
//
// The essential filter is handed the direction and rotation when one hypothesis is left and its variance is below
// `variance`, not at a fixed frame (which costs right answers at large noise), and runs through the last frames again from
// there, with a wide prior, and a gyroscope's bias as it was before them: their information counts once. The subspace
// filter goes on running, so that the fall-back loses nothing: it comes when the innovations of the essential filter are
// larger than those of the subspace filter, which needs no constant rotation, or its direction is no longer determined. The
// hand-over may come again after ten frames, and after twice as many each time.
//
// Rotation, gyroscope's bias and inverse depths are those of one frame, whatever interval the pairs have. The essential
// filter knows one interval alone: pairs over several frames never come to a hand-over.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/motion/essential_filter.hpp>
#include <fusion/motion/plan.hpp>
#include <fusion/motion/subspace_filter.hpp>
#include <fusion/motion/track_pairs.hpp>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace liestat {

struct MotionHandOver {
  bool essential = true;         ///< false: the subspace filter alone
  double variance = 0.003;       ///< rad²: trace of the direction's covariance below which it comes
  std::size_t frames = 20;       ///< the last frames, which the essential filter is run through from there,
  double start_variance = 0.01;  ///< rad²: with this of the direction and of the rotation
  /// Mean normalised innovation of the essential filter over that of the subspace filter, in the last ten frames, above
  /// which the rotation changes too much for the former. With 20 points the ratio has a standard deviation of 0.1.
  double fall_back = 1.5;
};

class MotionFilter {
 public:
  /// Pairs of successive frames.
  LIESTAT_FUSION_API explicit MotionFilter(const MotionFilterOptions& options = {},
                                           const MotionHandOver& hand_over = {});
  /// The filter of a plan. One with a fault runs and gives no usable estimate: look at plan.ok() first.
  LIESTAT_FUSION_API explicit MotionFilter(const MotionPlan& plan, const MotionHandOver& hand_over = {});

  /// The next frame of the tracks, and a gyroscope's rotation since the frame before it, with its covariance: the
  /// filter makes pairs, and of the rotations the prior of their interval, itself. The first frame has no motion.
  const MotionEstimate& update(std::span<const TrackObservation> frame);
  const MotionEstimate& update(std::span<const TrackObservation> frame,
                               const GyroscopeRotation& since_the_frame_before);
  /// The same with the rotation of preintegrated readings over the whole interval of the pairs, or nothing where there
  /// is none. The interval ends in this frame and begins interval() frames before.
  const MotionEstimate& updateOver(std::span<const TrackObservation> frame,
                                   const std::optional<GyroscopeRotation>& over_the_interval);
  /// Frames of the interval that the next frame of the tracks ends; 0 before the first one.
  std::size_t interval() const { return std::min(seen_, plan_.frames_apart); }

  /// The next frame as pairs that were made elsewhere, with a gyroscope's rotation over their interval, rad per frame.
  /// Discrete flow and essential filter take the pairs of the plan's interval alone (others: flag bad_input).
  const MotionEstimate& update(std::span<const PointPair> pairs) { return updatePairs(pairs, nullptr); }
  const MotionEstimate& update(std::span<const PointPair> pairs, const GyroscopeRotation& gyroscope) {
    return updatePairs(pairs, &gyroscope);
  }

  /// The motion of one frame, from the filter in charge. The directions differ in meaning where the subspace filter's
  /// flow is not Flow::discrete: MotionEstimate::meaning says which it is. A translation is that over the interval.
  const MotionEstimate& estimate() const { return estimate_; }
  /// The same in the unit of time of pairs(): an interval where the plan has whole intervals.
  const MotionEstimate& stepEstimate() const;
  /// The pairs of the last frame of tracks and the track of each, in the unit of time of the filter.
  std::span<const PointPair> pairs() const { return chosen_ ? std::span<const PointPair>(steps_) : tracks_.pairs(); }
  std::span<const std::uint64_t> tracks() const { return tracks_.tracks(); }
  /// True if the essential filter is in charge.
  bool essential_in_charge() const { return in_charge_; }
  std::size_t hand_overs() const { return hand_overs_; }
  std::size_t fall_backs() const { return fall_backs_; }
  /// Inverse depths of the pairs that the filter took, in units of the motion of one frame.
  std::span<const InverseDepth> inverse_depths();
  const MotionPlan& plan() const { return plan_; }
  const SubspaceFilter& subspace() const { return subspace_; }
  const EssentialFilter& essential() const { return essential_; }
  /// Forgets the motion; the tracks go on.
  void reset();
  /// Forgets the tracks; the motion goes on. The next frame is the first of a sequence.
  void beginSequence();

 private:
  /// A filter takes intervals of several frames as steps.
  bool stepsAreLonger() const { return plan_.whole_intervals && plan_.frames_apart > 1; }
  bool alwaysEssential() const { return plan_.filter == FilterChoice::essential; }
  const MotionEstimate& updateTracks(std::span<const TrackObservation> frame, const GyroscopeRotation* over);
  const MotionEstimate& updatePairs(std::span<const PointPair> pairs, const GyroscopeRotation* gyroscope);
  const MotionEstimate& step(std::span<const PointPair> pairs, const GyroscopeRotation* prior);
  Gaussian<Eigen::Vector3d> presentBias() const;
  void fallBack();
  const MotionEstimate& next(std::span<const PointPair> pairs, const GyroscopeRotation* gyroscope);

  MotionPlan plan_;
  MotionHandOver hand_over_;
  SubspaceFilter subspace_;
  EssentialFilter essential_;
  MotionEstimate estimate_;
  TrackPairs tracks_;
  std::size_t seen_ = 0;                                     ///< frames of the tracks
  std::vector<PointPair> steps_;                             ///< pairs of the interval, as steps
  bool chosen_ = false;                                      ///< the filter was given those
  std::vector<InverseDepth> depths_;                         ///< per frame, where steps are longer
  bool over_several_frames_ = false;                         ///< pairs are, or have been
  std::vector<std::optional<GyroscopeRotation>> rotations_;  ///< since the frame before, a ring as long as an interval
  struct Frame {
    std::vector<PointPair> pairs;
    GyroscopeRotation gyroscope;
    bool has_gyroscope = false;
    Gaussian<Eigen::Vector3d> bias;  ///< before this frame, where it is a state
  };
  std::vector<Frame> frames_;  ///< a ring
  std::size_t next_frame_ = 0, kept_frames_ = 0;
  bool in_charge_ = false;
  std::size_t hand_overs_ = 0, fall_backs_ = 0, waiting_ = 0;
  /// Frames over which innovations are averaged before the two filters are compared. The normalised innovation of one
  /// frame of 30 points scatters by a quarter, too much for a factor of `fall_back`; the mean of ten by a tenth
  /// (docs/theory/motion.md, section 8).
  static constexpr std::size_t innovation_frames = 10;
  double own_innovation_ = 0, other_innovation_ = 0;  ///< means over the last frames in charge
  std::size_t in_charge_for_ = 0;
};

/// T of X₂ = R X₁ + T from a velocity that is constant over the interval, T = J_l(Ω) V, or the direction itself where it
/// is one of a translation already; the covariance of the rotation is left out (|Ω|/2 of it, to first order).
LIESTAT_FUSION_API Gaussian<S2d> translationDirection(const MotionEstimate& estimate);
/// The velocity of a translation over the estimate's rotation, V ∝ J_l(Ω)⁻¹ T, or the direction itself; the covariance
/// as above.
LIESTAT_FUSION_API Gaussian<S2d> velocityDirection(const MotionEstimate& estimate);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/motion/detail/motion_filter_run.hpp>
#endif
