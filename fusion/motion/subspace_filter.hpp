// The subspace filter of Soatto and Perona 1994: the direction of translation on the sphere, recursively, from the flow
// of points, with rotation and depths eliminated in each frame. docs/motion.md.
//
//   liestat::SubspaceFilter filter;
//   for (…) if (filter.update(pairs).ok()) … filter.estimate().direction, filter.inverse_depths()
//
// Several starts compete (the cost has local minima, and one start in two fails), the sign of the direction is decided
// by depths over several frames, and the covariance has the second derivatives of the cost, without which noise counts
// as signal. With a gyroscope, update(pairs, gyroscope), two points are enough, and one linear start. Points may come and
// go: a pair is used in its own frame only. An update allocates nothing once the largest frame has been seen.
//
// Bad input: pairs with NaN or without a positive sigma are left out; a frame with fewer than eight pairs (two with a
// gyroscope), or one that a rotation alone explains, is only predicted. MotionFlags says so, and the state is kept.
#pragma once

#include <fusion/motion/detail/motion_engine.hpp>
#include <fusion/motion/types.hpp>

#include <span>
#include <vector>

namespace liestat {

class SubspaceFilter {
 public:
  explicit SubspaceFilter(const MotionFilterOptions& options = {})
      : engine_(options, options.estimate_bias ? detail::MotionState::gyroscope_bias : detail::MotionState::direction) {
  }

  /// The next frame.
  const MotionEstimate& update(std::span<const PointPair> pairs) { return engine_.update(pairs, nullptr); }
  const MotionEstimate& update(std::span<const PointPair> pairs, const GyroscopeRotation& gyroscope) {
    return engine_.update(pairs, &gyroscope);
  }
  /// After the last update.
  const MotionEstimate& estimate() const { return engine_.estimate(); }
  /// Values of the last update's pairs, in their order, at the present estimate; NaN for those that were not used.
  std::span<const InverseDepth> inverse_depths() { return engine_.inverseDepths(); }
  /// All that are left, the best among them.
  std::vector<MotionHypothesis> hypotheses() const {
    std::vector<MotionHypothesis> list;
    for (const detail::DirectionCandidate& c : engine_.candidates()) {
      const bool wide = engine_.options().estimate_bias;
      list.push_back({c.direction, wide ? Eigen::Matrix2d(c.wide.reported.topLeftCorner<2, 2>()) : c.narrow.reported,
                      c.Omega, c.score, c.start});
    }
    return list;
  }

  /// Starts from one direction with its covariance (and a rotation, for Flow::discrete) in place of many.
  void start(const Gaussian<S2d>& direction, const SO3d& rotation = {}) {
    detail::DirectionCandidate c;
    c.direction = direction.mean, c.rotation = rotation;
    c.narrow = {direction.covariance, direction.covariance};
    c.wide.gain.topLeftCorner<2, 2>() = direction.covariance;
    const double bias = engine_.options().bias_sigma;
    c.wide.gain.bottomRightCorner<3, 3>() = bias * bias * Eigen::Matrix3d::Identity();
    c.wide.reported = c.wide.gain;
    engine_.start(c);
  }
  /// Forgets everything.
  void reset() { engine_.reset(); }

 private:
  detail::MotionEngine engine_;
};

}  // namespace liestat
