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

LIESTAT_FUSION_INLINE const MotionEstimate& MotionFilter::next(std::span<const PointPair> pairs,
                                                               const GyroscopeRotation* gyroscope) {
  const MotionEstimate& own = gyroscope != nullptr ? subspace_.update(pairs, *gyroscope) : subspace_.update(pairs);
  if (!hand_over_.essential) return own;
  if (in_charge_) {
    const MotionEstimate& other =
        gyroscope != nullptr ? essential_.update(pairs, *gyroscope) : essential_.update(pairs);
    if (!other.flags.lost && !own.flags.lost) return other;
    in_charge_ = false;
    ++fall_backs_;
    waiting_ = options_.lost_frames;
    return own;
  }
  waiting_ -= waiting_ > 0 ? 1 : 0;
  if (waiting_ > 0 || !own.ok() || own.hypotheses != 1 || own.frame < options_.first_pruning ||
      !(own.direction.covariance.trace() < hand_over_.variance)) {
    return own;
  }
  const Gaussian<S2d> direction = translationDirection(own);
  Gaussian<Essentiald> state;
  state.mean = Essentiald(own.rotation.mean, direction.mean);
  state.covariance.setZero();
  state.covariance.topLeftCorner<2, 2>() = hand_over_.covariance_factor * direction.covariance;
  state.covariance.bottomRightCorner<3, 3>().diagonal().array() = hand_over_.rotation_variance;
  state.covariance.diagonal().array() += hand_over_.covariance_floor;
  essential_.reset();
  essential_.start(state);
  in_charge_ = true;
  ++hand_overs_;
  return own;
}

}  // namespace liestat
