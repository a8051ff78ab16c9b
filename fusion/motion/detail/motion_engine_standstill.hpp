// MotionEngine at standstill: frames that say nothing of the direction, and the rotation that they do say.
#pragma once

#include <fusion/motion/detail/motion_engine.hpp>
#include <fusion/motion/detail/motion_statistics.hpp>
#include <lie/manifold.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat::detail {

/// One set of points serves all hypotheses unless each turns them by a rotation of its own.
LIESTAT_FUSION_INLINE bool MotionEngine::turnedPerCandidate() const {
  if (options_.flow != Flow::discrete) return false;
  return state_ != MotionState::direction || !frame_.has_gyroscope;
}

LIESTAT_FUSION_INLINE void MotionEngine::flowsAfter(const SO3d& R) {
  const Eigen::Matrix3d matrix = R.matrix();
  for (std::size_t i = 0; i < pairs_.size(); ++i) {
    points_[i] = flowAfter(matrix, pairs_[i]);
    // A point that the rotation turns out of sight takes no part.
    if (!std::isfinite(points_[i].x)) {
      points_[i] = FlowPoint<double>{};
      points_[i].variance = std::numeric_limits<double>::infinity();
    }
  }
}

LIESTAT_FUSION_INLINE void MotionEngine::prepareSharedFlows() {
  if (turnedPerCandidate()) return;
  if (options_.flow == Flow::discrete) {
    flowsAfter(SO3d::exp(frame_.gyroscope));
  } else {
    for (std::size_t i = 0; i < pairs_.size(); ++i) points_[i] = flowOf(pairs_[i], options_.flow);
  }
}

/// True if the frame says nothing of the direction. Where noise drowns the motion of one frame, many frames together do
/// say something, though each of them looks like standstill: a frame is left out only if others have shown a clear motion.
/// If none has, hypotheses are updated, and start anew with the first clear motion after frames without any.
LIESTAT_FUSION_INLINE bool MotionEngine::atStandstill() {
  double statistic = 0;
  const double dof = fitRotationAlone(statistic);
  estimate_.signal = dof > 0 ? statistic / dof : std::numeric_limits<double>::quiet_NaN();
  if (!(dof > 0)) return false;
  const double bound = chiSquaredBound(dof, standstill_quantile_) / dof;
  // A stop goes on: after a still frame only one in a thousand is missed.
  const bool still = estimate_.signal <= (was_still_ ? chiSquaredBound(dof, 3.1) / dof : bound);
  was_still_ = still;
  // A frame with the usual signal is below the bound by chance once in a thousand times or so: the standard deviation
  // of χ² of k degrees of freedom with the mean s k is √(2 (2 s - 1) k).
  const auto isClear = [&] {
    return usual_signal_ - 3 * std::sqrt(2 * std::max(2 * usual_signal_ - 1, 1.0) / dof) > bound;
  };
  const bool clear_before = isClear();
  if (!clear_before) still_sum_ += statistic, still_dof_ += dof;
  if (!still) {
    ++moving_frames_;
    usual_signal_ +=
        (estimate_.signal - usual_signal_) / static_cast<double>(std::min<std::size_t>(moving_frames_, 10));
    if (!clear_before && isClear()) {
      const double rest = still_dof_ - dof;
      if (rest > 0 && still_sum_ - statistic <= chiSquaredBound(rest, standstill_quantile_)) startAnew();
    }
    return false;
  }
  estimate_.flags.standstill = clear_before || still_sum_ <= chiSquaredBound(still_dof_, standstill_quantile_);
  if (clear_before) updateRotationAlone();
  return clear_before;
}

LIESTAT_FUSION_INLINE void MotionEngine::startAnew() {
  candidates_.clear();
  fit_since_start_ = way_count_ = 0, process_noise_ = 0;
  best_ = updates_ = kept_ = innovation_count_ = 0, innovation_sum_ = 0;
  linear_moments_.setZero(), linear_noise_.setZero();
}

/// The least Σ |ẋ - BΩ|²/variance, and its degrees of freedom; none where it can't be had. Among outliers a tenth of
/// the points and one more are left out, or as many as the frames before had; each further one counts with the limit
/// that it is beyond. One that lies along the flow of the present direction, ahead of the camera, is no outlier but
/// motion, and counts whole, but for the few that come there by chance. With the rotation so found points are turned
/// and the rest is fitted again, so that large rotations are no signal.
LIESTAT_FUSION_INLINE double MotionEngine::fitRotationAlone(double& statistic) {
  rotation_prior_ = priorWithoutBias();
  const RotationPrior<double>& prior = rotation_prior_;
  Eigen::Vector3d Omega = prior.mean;
  const double limit = 11.8;  // χ² of two degrees of freedom, as likely as 3 standard deviations
  const bool robust = options_.outliers;
  const std::size_t n = pairs_.size();
  std::fill(weights_.begin(), weights_.end(), 1.0);
  std::size_t used = n;
  Eigen::Matrix3d M = Eigen::Matrix3d::Zero();
  const int passes = robust ? 8 : 2;
  for (int pass = 0; pass < passes; ++pass) {
    Eigen::Matrix3d R = SO3d::exp(Omega).matrix();
    double frames = 1;
    M = prior.information;
    Eigen::Vector3d b = prior.information * (prior.mean - Omega);
    for (std::size_t i = 0; i < n; ++i) {
      if (pairs_[i].frames != frames) {
        frames = pairs_[i].frames;
        R = SO3d::exp(Eigen::Vector3d(frames * Omega)).matrix();
      }
      FlowPoint<double>& p = points_[i] = flowAfter(R, pairs_[i]);
      if (!std::isfinite(p.x)) return 0;
      const double k = 1 / frames;
      p.u *= k, p.v *= k, p.variance *= k * k;
      const Eigen::Matrix<double, 2, 3> B = flowByRotation(p.x, p.y);
      const double w = weights_[i] / p.variance;
      M += w * B.transpose() * B;
      b += w * B.transpose() * Eigen::Vector2d(p.u, p.v);
    }
    const Eigen::Vector3d d = Cholesky<double, 3>(M).solve<1>(b);
    if (!d.allFinite()) return 0;
    const Eigen::Vector3d from_gyroscope = Omega + d - prior.mean;
    statistic = from_gyroscope.dot(prior.information * from_gyroscope), used = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const FlowPoint<double>& p = points_[i];
      const Eigen::Vector2d rest = Eigen::Vector2d(p.u, p.v) - flowByRotation(p.x, p.y) * d;
      const double squared = rest.squaredNorm() / p.variance;
      if (!robust) {
        statistic += squared, ++used;
        continue;
      }
      // Geman and McClure while the inliers are sought, then all or none.
      const double f = 1 / (1 + squared / limit);
      weights_[i] = pass + 3 < passes ? f * f : squared < limit ? 1 : 0;
      if (squared < limit) statistic += squared, ++used;
    }
    Omega += d;
  }
  rotation_alone_ = SO3d::exp(Omega), rotation_information_ = M, rotation_inliers_ = used;
  double along = 0;
  std::size_t explained = 0;
  if (const DirectionCandidate* c = best(); c != nullptr && used < n) {
    for (std::size_t i = 0; i < n; ++i) {
      if (weights_[i] > 0) continue;
      const FlowRow<double> row = flowRow<double>(points_[i], c->direction.unit_vector());
      const double squared = row.weight * row.q * row.q;
      const double length = row.n1 * points_[i].u - row.n0 * points_[i].v;
      if (squared < 9 && length > 0) along += row.weight * length * length, ++explained;
    }
  }
  const double number = static_cast<double>(n), usual = outlier_share_ * number;
  const auto allowed = std::max(n / 10 + 1, static_cast<std::size_t>(usual + 2 * std::sqrt(usual)));
  const std::size_t left_out = n - used - explained, counted = left_out > allowed ? left_out - allowed : 0;
  const std::size_t by_chance = 1 + n / 50;
  if (explained > by_chance) {
    statistic += along * static_cast<double>(explained - by_chance) / static_cast<double>(explained);
  }
  statistic += limit * static_cast<double>(counted);
  if (!std::isfinite(statistic)) return 0;
  return 2 * static_cast<double>(used + counted) - (frame_.has_gyroscope ? 0 : 3);
}

/// The gyroscope's rotation as far as its bias is known, without that.
LIESTAT_FUSION_INLINE RotationPrior<double> MotionEngine::priorWithoutBias() const {
  RotationPrior<double> prior{frame_.gyroscope, frame_.information};
  if (!frame_.has_gyroscope || !keepsTheBias(state_)) return prior;
  Eigen::Matrix3d covariance = Cholesky<double, 3>(frame_.information).inverse();
  if (const DirectionCandidate* c = best()) {
    prior.mean -= c->bias;
    covariance += c->biasCovariance(state_);
  } else {
    covariance.diagonal().array() += options_.bias_sigma * options_.bias_sigma;
  }
  prior.information = Cholesky<double, 3>(covariance).inverse();
  return prior;
}

/// A hypothesis at standstill: what the flow says of the rotation, and with it of the gyroscope's bias.
LIESTAT_FUSION_INLINE void MotionEngine::updateRotationOf(DirectionCandidate& c) {
  if (!keepsTheRotation(state_)) c.rotation = rotation_alone_;
  if (state_ == MotionState::direction) return;
  const auto fromState = [&](const SO3d& R) { return (R * c.rotation.inverse()).log(); };
  const Eigen::Vector3d pull = rotation_information_ * fromState(rotation_alone_);
  if (state_ == MotionState::rotation) {
    FrameInformation<double, 5> frame;
    frame.gauss_newton.setZero();
    frame.gauss_newton.bottomRightCorner<3, 3>() = rotation_information_;
    frame.corrected = frame.gauss_newton;
    frame.gradient << 0, 0, -pull;
    const FilterStep<double, 5> s = updateCovariance(c.wide, frame, options_.max_step);
    c.rotation = SO3d::exp(Eigen::Vector3d(s.step.tail<3>())) * c.rotation;
    return;
  }
  // The flow by itself, without the gyroscope's share, and the gyroscope as a measurement of rotation and bias.
  SubspaceSums<double> flow;
  flow.Hxx.setZero(), flow.Cxx.setZero(), flow.Hox.setZero(), flow.Cox.setZero(), flow.bx.setZero();
  flow.M = rotation_information_ - rotation_prior_.information;
  flow.bo = rotation_prior_.information * fromState(SO3d::exp(rotation_prior_.mean)) - pull;
  const Eigen::Vector3d gyroscope = frame_.gyroscope - c.bias, here = Eigen::Vector3d::Zero();
  RotationPrior<double> prior{Eigen::Vector3d::Zero(), frame_.information};
  if (frame_.has_gyroscope) prior.mean = fromState(SO3d::exp(gyroscope));
  if (state_ == MotionState::gyroscope_bias) {
    if (!frame_.has_gyroscope) return;
    const FilterStep<double, 5> s =
        updateCovariance(c.wide, eliminateRotationWithBias(flow, here, prior, frame_.information), options_.max_step);
    c.bias += s.step.tail<3>();
    return;
  }
  const Eigen::Matrix3d turn = SO3d::leftJacobian(gyroscope);
  const FilterStep<double, 8> s =
      updateCovariance(c.whole, keepRotationAndBias(flow, here, prior, turn, frame_.information), options_.max_step);
  c.rotation = SO3d::exp(Eigen::Vector3d(s.step.segment<3>(2))) * c.rotation;
  c.bias += s.step.tail<3>();
  c.copyFromWhole();
}

/// At standstill the flow says the rotation, better than the filter does.
LIESTAT_FUSION_INLINE void MotionEngine::updateRotationAlone() {
  estimate_.rotation.mean = rotation_alone_;
  const Eigen::Matrix3d R = rotation_alone_.matrix();
  estimate_.rotation.covariance = R.transpose() * Cholesky<double, 3>(rotation_information_).inverse() * R;
  estimate_.inliers = rotation_inliers_;
  for (DirectionCandidate& c : candidates_) updateRotationOf(c);
}

}  // namespace liestat::detail
