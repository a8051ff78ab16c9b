// Definitions of fusion/motion/motion_filter.hpp.
#pragma once

#include <fusion/motion/gyroscope.hpp>
#include <fusion/motion/motion_filter.hpp>

#include <algorithm>

namespace liestat {

namespace detail {

/// The direction that a linear map makes of another one, with its covariance.
inline Gaussian<S2d> mapped(const Gaussian<S2d>& direction, const Eigen::Matrix3d& J) {
  const Eigen::Vector3d moved = J * direction.mean.unit_vector();
  const S2d to(moved);
  // d(J V/|J V|) along the tangent planes' axes.
  const Eigen::Matrix<double, 3, 2> before = ManifoldTraits<S2d>::placement(direction.mean).matrix().leftCols<2>();
  const Eigen::Matrix<double, 3, 2> after = ManifoldTraits<S2d>::placement(to).matrix().leftCols<2>();
  const Eigen::Matrix2d D = after.transpose() * (J * before) / moved.norm();
  return {to, D * direction.covariance * D.transpose()};
}

}  // namespace detail

LIESTAT_FUSION_INLINE Gaussian<S2d> translationDirection(const MotionEstimate& estimate) {
  if (estimate.meaning == DirectionMeaning::translation) return estimate.direction;
  return detail::mapped(estimate.direction, SO3d::leftJacobian(estimate.rotation.mean.log()));
}

LIESTAT_FUSION_INLINE Gaussian<S2d> velocityDirection(const MotionEstimate& estimate) {
  if (estimate.meaning == DirectionMeaning::velocity) return estimate.direction;
  return detail::mapped(estimate.direction, SO3d::leftJacobianInverse(estimate.rotation.mean.log()));
}

LIESTAT_FUSION_INLINE MotionFilter::MotionFilter(const MotionFilterOptions& options, const MotionHandOver& hand_over)
    : MotionFilter(MotionPlan{.settings = options, .whole_intervals = options.flow == Flow::discrete}, hand_over) {}

LIESTAT_FUSION_INLINE MotionFilter::MotionFilter(const MotionPlan& plan, const MotionHandOver& hand_over)
    : plan_(plan),
      hand_over_(hand_over),
      subspace_(plan.settings),
      essential_(plan.settings),
      tracks_({.frames = plan.frames_apart, .shorter = !plan.whole_intervals}),
      rotations_(plan.frames_apart),
      in_charge_(plan.filter == FilterChoice::essential) {
  if (plan.filter == FilterChoice::subspace) hand_over_.essential = false;
  estimate_ = stepEstimate();
}

LIESTAT_FUSION_INLINE void MotionFilter::reset() {
  subspace_.reset(), essential_.reset();
  kept_frames_ = next_frame_ = 0;
  in_charge_ = alwaysEssential(), over_several_frames_ = false;
  waiting_ = 0;
  estimate_ = stepEstimate();
}

LIESTAT_FUSION_INLINE void MotionFilter::beginSequence() {
  tracks_ = TrackPairs({.frames = plan_.frames_apart, .shorter = !plan_.whole_intervals});
  seen_ = 0;
}

LIESTAT_FUSION_INLINE const MotionEstimate& MotionFilter::stepEstimate() const {
  return in_charge_ ? essential_.estimate() : subspace_.estimate();
}

LIESTAT_FUSION_INLINE const MotionEstimate& MotionFilter::update(std::span<const TrackObservation> frame) {
  rotations_[seen_ % rotations_.size()].reset();
  return updateTracks(frame, nullptr);
}

LIESTAT_FUSION_INLINE const MotionEstimate& MotionFilter::update(std::span<const TrackObservation> frame,
                                                                 const GyroscopeRotation& since_the_frame_before) {
  rotations_[seen_ % rotations_.size()] = since_the_frame_before;
  std::optional<GyroscopeRotation> over;
  for (std::size_t k = interval(); k > 0; --k) {
    const auto& one = rotations_[(seen_ + 1 - k) % rotations_.size()];
    if (!one) {
      over.reset();
      break;
    }
    over = over ? composed(*over, *one) : one;
  }
  return updateTracks(frame, over ? &*over : nullptr);
}

LIESTAT_FUSION_INLINE const MotionEstimate& MotionFilter::updateOver(
    std::span<const TrackObservation> frame, const std::optional<GyroscopeRotation>& over_the_interval) {
  return updateTracks(frame, over_the_interval ? &*over_the_interval : nullptr);
}

LIESTAT_FUSION_INLINE const MotionEstimate& MotionFilter::updateTracks(std::span<const TrackObservation> frame,
                                                                       const GyroscopeRotation* over) {
  const std::size_t frames = interval();
  const std::span<const PointPair> pairs = tracks_.add(frame);
  if (seen_++ == 0) return estimate_;
  if (over == nullptr) return step(pairs, nullptr);
  const GyroscopeRotation prior = priorOfInterval(*over, frames, plan_.whole_intervals);
  return step(pairs, &prior);
}

LIESTAT_FUSION_INLINE const MotionEstimate& MotionFilter::updatePairs(std::span<const PointPair> pairs,
                                                                      const GyroscopeRotation* gyroscope) {
  if (gyroscope == nullptr || !stepsAreLonger()) return step(pairs, gyroscope);
  const auto n = static_cast<double>(plan_.frames_apart);
  const GyroscopeRotation prior{n * gyroscope->rotation, n * n * gyroscope->covariance};
  return step(pairs, &prior);
}

/// A frame's pairs with their prior in the filter's unit of time; the motion is made one of a frame.
LIESTAT_FUSION_INLINE const MotionEstimate& MotionFilter::step(std::span<const PointPair> pairs,
                                                               const GyroscopeRotation* prior) {
  const auto n = static_cast<double>(plan_.frames_apart);
  bool left_out = false;
  if (plan_.whole_intervals) {
    const auto is_step = [n](const PointPair& pair) { return pair.frames == n; };
    left_out = !std::all_of(pairs.begin(), pairs.end(), is_step);
    chosen_ = left_out || plan_.frames_apart > 1;
    if (chosen_) pairsOver(n, pairs, steps_);
  } else if (!over_several_frames_) {
    over_several_frames_ =
        std::any_of(pairs.begin(), pairs.end(), [](const PointPair& pair) { return pair.frames > 1; });
    if (over_several_frames_ && in_charge_) fallBack();
  }
  const MotionEstimate& own = next(chosen_ ? std::span<const PointPair>(steps_) : pairs, prior);
  estimate_ = stepsAreLonger() ? perFrame(own, plan_.frames_apart) : own;
  estimate_.flags.bad_input = estimate_.flags.bad_input || left_out || !plan_.ok();
  estimate_.flags.degenerate = estimate_.flags.degenerate || !plan_.ok();
  return estimate_;
}

LIESTAT_FUSION_INLINE std::span<const InverseDepth> MotionFilter::inverse_depths() {
  const std::span<const InverseDepth> own = in_charge_ ? essential_.inverse_depths() : subspace_.inverse_depths();
  if (!stepsAreLonger()) return own;
  const auto n = static_cast<double>(plan_.frames_apart);
  depths_.assign(own.begin(), own.end());
  for (InverseDepth& depth : depths_) depth.value /= n, depth.variance /= n * n;
  return depths_;
}

/// The gyroscope's bias before the next frame: as the options expect it until the filter has a hypothesis.
LIESTAT_FUSION_INLINE Gaussian<Eigen::Vector3d> MotionFilter::presentBias() const {
  if (subspace_.estimate().hypotheses > 0) return subspace_.estimate().gyroscope_bias;
  return {Eigen::Vector3d::Zero(), plan_.settings.bias_sigma * plan_.settings.bias_sigma * Eigen::Matrix3d::Identity()};
}

LIESTAT_FUSION_INLINE void MotionFilter::fallBack() {
  in_charge_ = false;
  waiting_ = plan_.settings.lost_frames << std::min<std::size_t>(fall_backs_, 8);
  ++fall_backs_;
  kept_frames_ = next_frame_ = 0;
}

LIESTAT_FUSION_INLINE const MotionEstimate& MotionFilter::next(std::span<const PointPair> pairs,
                                                               const GyroscopeRotation* gyroscope) {
  if (alwaysEssential()) {
    return gyroscope != nullptr ? essential_.update(pairs, *gyroscope) : essential_.update(pairs);
  }
  const Gaussian<Eigen::Vector3d> bias_before = presentBias();
  const MotionEstimate& own = gyroscope != nullptr ? subspace_.update(pairs, *gyroscope) : subspace_.update(pairs);
  if (!hand_over_.essential || over_several_frames_) return own;
  if (in_charge_) {
    const MotionEstimate& other =
        gyroscope != nullptr ? essential_.update(pairs, *gyroscope) : essential_.update(pairs);
    if (other.cost > 0 && own.cost > 0 && !other.flags.standstill && !other.flags.too_few) {
      const auto n = static_cast<double>(std::min(++in_charge_for_, innovation_frames));
      own_innovation_ += (own.innovation - own_innovation_) / n;
      other_innovation_ += (other.innovation - other_innovation_) / n;
    }
    const bool changes =
        in_charge_for_ >= innovation_frames && other_innovation_ > hand_over_.fall_back * own_innovation_;
    const bool loses = (other.flags.degenerate || other.flags.misfit) && !own.flags.degenerate && !own.flags.misfit;
    if (!other.flags.lost && !own.flags.lost && !changes && !loses) return other;
    fallBack();
    return own;
  }
  if (hand_over_.frames > 0) {
    if (frames_.empty()) frames_.resize(hand_over_.frames);
    for (Frame& kept : frames_) kept.pairs.reserve(pairs.size());
    Frame& frame = frames_[next_frame_++ % frames_.size()];
    kept_frames_ = std::min(kept_frames_ + 1, frames_.size());
    frame.pairs.assign(pairs.begin(), pairs.end());
    frame.has_gyroscope = gyroscope != nullptr;
    if (gyroscope != nullptr) frame.gyroscope = *gyroscope;
    frame.bias = bias_before;
  }
  waiting_ -= waiting_ > 0 ? 1 : 0;
  if (waiting_ > 0 || !own.ok() || own.hypotheses != 1 || own.frame < plan_.settings.first_pruning ||
      !(own.direction.covariance.trace() < hand_over_.variance)) {
    return own;
  }
  Gaussian<Essentiald> state;
  state.mean = Essentiald(own.rotation.mean, translationDirection(own).mean);
  state.covariance = hand_over_.start_variance * Eigen::Matrix<double, 5, 5>::Identity();
  essential_.start(state, kept_frames_ > 0 ? frames_[(next_frame_ - kept_frames_) % frames_.size()].bias : bias_before);
  for (std::size_t k = kept_frames_; k > 0; --k) {
    const Frame& frame = frames_[(next_frame_ - k) % frames_.size()];
    if (frame.has_gyroscope) {
      essential_.update(frame.pairs, frame.gyroscope);
    } else {
      essential_.update(frame.pairs);
    }
  }
  if (essential_.estimate().flags.lost || essential_.estimate().flags.degenerate) {
    fallBack();
    return own;
  }
  in_charge_ = true;
  in_charge_for_ = 0, own_innovation_ = other_innovation_ = 0;
  ++hand_overs_;
  return essential_.estimate();
}

}  // namespace liestat
