// Definitions of fusion/motion/motion_filter.hpp.
#pragma once

#include <fusion/motion/motion_filter.hpp>

#include <algorithm>

namespace liestat {

LIESTAT_FUSION_INLINE Gaussian<S2d> translationDirection(const MotionEstimate& estimate) {
  if (estimate.meaning == DirectionMeaning::translation) return estimate.direction;
  const Eigen::Matrix3d J = SO3d::leftJacobian(estimate.rotation.mean.log());
  const Eigen::Vector3d V = estimate.direction.mean.unit_vector(), moved = J * V;
  const S2d T(moved);
  // d(J V/|J V|) along the tangent planes' axes.
  const Eigen::Matrix<double, 3, 2> from =
      ManifoldTraits<S2d>::placement(estimate.direction.mean).matrix().leftCols<2>();
  const Eigen::Matrix<double, 3, 2> to = ManifoldTraits<S2d>::placement(T).matrix().leftCols<2>();
  const Eigen::Matrix2d D = to.transpose() * (J * from) / moved.norm();
  return {T, D * estimate.direction.covariance * D.transpose()};
}

/// The gyroscope's bias before the next frame: as the options expect it until the filter has a hypothesis.
LIESTAT_FUSION_INLINE Gaussian<Eigen::Vector3d> MotionFilter::presentBias() const {
  if (subspace_.estimate().hypotheses > 0) return subspace_.estimate().gyroscope_bias;
  return {Eigen::Vector3d::Zero(), options_.bias_sigma * options_.bias_sigma * Eigen::Matrix3d::Identity()};
}

LIESTAT_FUSION_INLINE void MotionFilter::fallBack() {
  in_charge_ = false;
  waiting_ = options_.lost_frames << std::min<std::size_t>(fall_backs_, 8);
  ++fall_backs_;
  kept_frames_ = next_frame_ = 0;
}

LIESTAT_FUSION_INLINE const MotionEstimate& MotionFilter::next(std::span<const PointPair> pairs,
                                                               const GyroscopeRotation* gyroscope) {
  const Gaussian<Eigen::Vector3d> bias_before = presentBias();
  const MotionEstimate& own = gyroscope != nullptr ? subspace_.update(pairs, *gyroscope) : subspace_.update(pairs);
  if (!hand_over_.essential) return own;
  if (in_charge_) {
    const MotionEstimate& other =
        gyroscope != nullptr ? essential_.update(pairs, *gyroscope) : essential_.update(pairs);
    if (other.cost > 0 && own.cost > 0 && !other.flags.standstill && !other.flags.too_few) {
      const auto n = static_cast<double>(std::min<std::size_t>(++in_charge_for_, 10));
      own_innovation_ += (own.innovation - own_innovation_) / n;
      other_innovation_ += (other.innovation - other_innovation_) / n;
    }
    const bool changes = in_charge_for_ >= 10 && other_innovation_ > hand_over_.fall_back * own_innovation_;
    const bool loses = other.flags.degenerate && !own.flags.degenerate;
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
  if (waiting_ > 0 || !own.ok() || own.hypotheses != 1 || own.frame < options_.first_pruning ||
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
