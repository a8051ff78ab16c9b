// The essential filter: rotation and direction of translation between successive frames, both as states on the essential
// manifold, recursively (S. Soatto, R. Frezza, P. Perona, "Motion estimation on the essential manifold", ECCV 1994; here
// with the loop of fusion/motion/subspace_filter.hpp: several starts, sign by depths, second derivatives).
//
//   liestat::EssentialFilter filter({.starts = 1});
//   filter.start(essential);                  // a direction and a rotation with their covariance, or 32 starts
//   … filter.update(pairs).ok() … filter.essential()
//
// The rotation is assumed to change slowly, by MotionFilterOptions::rotation_noise per frame: it is then known from all
// frames and not from one, which makes directions twice as accurate. Where it changes, the innovation rises and the
// filter is lost; fusion/motion/motion_filter.hpp falls back to the subspace filter. Options as there; Flow::discrete always.
// With MotionFilterOptions::estimate_bias a gyroscope's bias is a state too.
#pragma once

#include <fusion/motion/detail/motion_engine.hpp>
#include <fusion/motion/types.hpp>
#include <lie/essential.hpp>

#include <span>
#include <vector>

namespace liestat {

class EssentialFilter {
 public:
  explicit EssentialFilter(const MotionFilterOptions& options = {})
      : engine_(options,
                options.estimate_bias ? detail::MotionState::rotation_and_bias : detail::MotionState::rotation) {}

  /// The next frame.
  const MotionEstimate& update(std::span<const PointPair> pairs) { return engine_.update(pairs, nullptr); }
  const MotionEstimate& update(std::span<const PointPair> pairs, const GyroscopeRotation& gyroscope) {
    return engine_.update(pairs, &gyroscope);
  }
  /// After the last update; the direction is that of the translation.
  const MotionEstimate& estimate() const { return engine_.estimate(); }
  /// The same as one point with its joint covariance, second_T_first; 1 rad² each before the first frame.
  Gaussian<Essentiald> essential() const {
    Gaussian<Essentiald> g;
    if (const detail::DirectionCandidate* c = engine_.best()) {
      g.mean = Essentiald(c->rotation, c->direction);
      // The engine's rotation error is along the axes of the second frame, that of Essential along the direction's.
      g.covariance = turned(c->wide.reported, frameOf(c->direction).transpose());
    }
    return g;
  }
  /// Values of the last update's pairs, in their order, at the present estimate; NaN for those that were not used.
  std::span<const InverseDepth> inverse_depths() { return engine_.inverseDepths(); }
  std::vector<MotionHypothesis> hypotheses() const {
    std::vector<MotionHypothesis> list;
    for (const detail::DirectionCandidate& c : engine_.candidates()) {
      list.push_back(
          {c.direction, Eigen::Matrix2d(c.wide.reported.topLeftCorner<2, 2>()), c.rotation.log(), c.score, c.start});
    }
    return list;
  }

  /// Starts from one state in place of many; a gyroscope's bias, where it is a state, is expected as in the options.
  void start(const Gaussian<Essentiald>& state) {
    const double sigma = engine_.options().bias_sigma;
    start(state, {Eigen::Vector3d::Zero(), sigma * sigma * Eigen::Matrix3d::Identity()});
  }
  /// The same with a bias that is known better (rad per frame, with the sign of GyroscopeRotation).
  void start(const Gaussian<Essentiald>& state, const Gaussian<Eigen::Vector3d>& bias) {
    detail::DirectionCandidate c;
    c.direction = S2d(Eigen::Vector3d(state.mean.direction().unit_vector()));
    c.rotation = SO3d(state.mean.so3());
    c.wide.gain = c.wide.reported = turned(state.covariance, frameOf(c.direction));
    c.bias = engine_.options().estimate_bias ? bias.mean : Eigen::Vector3d::Zero();
    c.whole.gain.setZero();
    c.whole.gain.topLeftCorner<5, 5>() = c.wide.gain;
    c.whole.gain.bottomRightCorner<3, 3>() = bias.covariance;
    c.whole.reported = c.whole.gain;
    engine_.start(c);
  }
  void reset() { engine_.reset(); }

 private:
  using Matrix5 = Eigen::Matrix<double, 5, 5>;
  static Eigen::Matrix3d frameOf(const S2d& direction) { return ManifoldTraits<S2d>::placement(direction).matrix(); }
  static Matrix5 turned(Matrix5 P, const Eigen::Matrix3d& A) {
    P.bottomRows<3>() = (A * P.bottomRows<3>()).eval();
    P.rightCols<3>() = (P.rightCols<3>() * A.transpose()).eval();
    return P;
  }

  detail::MotionEngine engine_;
};

}  // namespace liestat
