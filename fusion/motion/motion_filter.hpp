// The filter to use where nothing else is asked for: the subspace filter until it has settled on one direction, then the
// essential filter beside it, and back to the former when the rotation turns out to change.
//
//   liestat::MotionFilter filter;
//   for (…) if (filter.update(pairs).ok()) … filter.estimate()
//
// The essential filter is handed the direction and rotation when one hypothesis is left and its variance is below
// `variance`, not at a fixed frame (which costs right answers at large noise), and runs through the last frames again from
// there, with a wide prior, and a gyroscope's bias as it was before them: their information counts once. The subspace
// filter goes on running, so that the fall-back loses nothing: it comes when the innovations of the essential filter are
// larger than those of the subspace filter, which needs no constant rotation, or its direction is no longer determined. The
// hand-over may come again after ten frames, and after twice as many each time.
#pragma once

#include <fusion/motion/essential_filter.hpp>
#include <fusion/motion/subspace_filter.hpp>

#include <cstddef>
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
  explicit MotionFilter(const MotionFilterOptions& options = {}, const MotionHandOver& hand_over = {})
      : options_(options), hand_over_(hand_over), subspace_(options), essential_(options) {}

  /// The next frame.
  const MotionEstimate& update(std::span<const PointPair> pairs) { return next(pairs, nullptr); }
  const MotionEstimate& update(std::span<const PointPair> pairs, const GyroscopeRotation& gyroscope) {
    return next(pairs, &gyroscope);
  }
  /// Of the filter in charge. The directions differ in meaning where the subspace filter's flow is not Flow::discrete:
  /// MotionEstimate::meaning says which it is.
  const MotionEstimate& estimate() const { return in_charge_ ? essential_.estimate() : subspace_.estimate(); }
  /// Whether that is the essential filter.
  bool essential_in_charge() const { return in_charge_; }
  std::size_t hand_overs() const { return hand_overs_; }
  std::size_t fall_backs() const { return fall_backs_; }
  std::span<const InverseDepth> inverse_depths() {
    return in_charge_ ? essential_.inverse_depths() : subspace_.inverse_depths();
  }
  const SubspaceFilter& subspace() const { return subspace_; }
  const EssentialFilter& essential() const { return essential_; }
  void reset() {
    subspace_.reset(), essential_.reset();
    kept_frames_ = next_frame_ = 0;
    in_charge_ = false, hand_overs_ = fall_backs_ = waiting_ = 0;
  }

 private:
  Gaussian<Eigen::Vector3d> presentBias() const;
  void fallBack();
  const MotionEstimate& next(std::span<const PointPair> pairs, const GyroscopeRotation* gyroscope);

  MotionFilterOptions options_;
  MotionHandOver hand_over_;
  SubspaceFilter subspace_;
  EssentialFilter essential_;
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
  double own_innovation_ = 0, other_innovation_ = 0;  ///< means over the last ten frames in charge
  std::size_t in_charge_for_ = 0;
};

/// T of X₂ = R X₁ + T from a velocity that is constant over the interval, T = J_l(Ω) V, or the direction itself where it
/// is one of a translation already; the covariance of the rotation is left out (|Ω|/2 of it, to first order).
Gaussian<S2d> translationDirection(const MotionEstimate& estimate);

}  // namespace liestat

#ifndef LIESTAT_COMPILED_FUSION
#include <fusion/detail/motion_filter_run.hpp>
#endif
