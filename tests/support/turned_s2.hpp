// TurnedS2: the sphere with another placement, to show that no result depends on the placement that S2 chose. Its
// frame at x is that of S2 turned about x by an angle that varies over the sphere. Also an example of a user's type:
// traits alone, no member of the library's types.
#pragma once

#include <lie/s2.hpp>

namespace liestat_test {

template <class S>
struct TurnedS2 {
  liestat::S2<S> direction;
};

}  // namespace liestat_test

template <class S>
struct liestat::ManifoldTraits<liestat_test::TurnedS2<S>> {
  using M = liestat_test::TurnedS2<S>;
  using Base = ManifoldTraits<S2<S>>;
  using Group = typename Base::Group;
  using Scalar = S;
  static constexpr int DoF = 2;
  using Tangent = typename Base::Tangent;
  using Square = typename Base::Square;

  /// How much the frame at x is turned; zero at the origin.
  static S turn(const M& x) { return S(2) * x.direction.params()[0] - S(0.7) * x.direction.params()[1]; }
  static Group turning(const M& x) { return Group::rotZ(turn(x)); }
  static Square rotation(const M& x) { return turning(x).matrix().template topLeftCorner<2, 2>(); }

  static M origin() { return {}; }
  static M act(const Group& f, const M& x) { return {Base::act(f, x.direction)}; }
  static Group placement(const M& x) { return Base::placement(x.direction) * turning(x); }
  static Group transvection(const M& x) { return Base::placement(x.direction); }
  static Eigen::Matrix<S, 3, 2> transvectionJacobian() { return Base::placementJacobian(Base::origin()); }
  static M expOrigin(const Tangent& v) { return {Base::expOrigin(v)}; }
  static Tangent logOrigin(const M& x) { return Base::logOrigin(x.direction); }
  static Square dexpOrigin(const Tangent& v) {
    return rotation(M{Base::expOrigin(v)}).transpose() * Base::dexpOrigin(v);
  }
  static Square dlogOrigin(const M& x) { return Base::dlogOrigin(x.direction) * rotation(x); }
  static Square isotropy(const Group& f, const M& x) {
    return rotation(act(f, x)).transpose() * Base::isotropy(f, x.direction) * rotation(x);
  }
  static Eigen::Matrix<S, 2, 3> originProjection() { return Base::originProjection(); }
  /// For x moved by v, S2's frame turns by J R v and the turning by the change of its angle, R = rotation(x).
  static Eigen::Matrix<S, 3, 2> placementJacobian(const M& x) {
    const Square R = rotation(x);
    Eigen::Matrix<S, 3, 2> m = turning(x).inverse().Adj() * Base::placementJacobian(x.direction) * R;
    const Eigen::Matrix<S, 3, 2> axes = Base::placement(x.direction).matrix().template leftCols<2>();
    m.row(2) += (S(2) * axes.row(0) - S(0.7) * axes.row(1)) * R;
    return m;
  }
  static bool isPlacementSmooth(const M& x) { return Base::isPlacementSmooth(x.direction); }

  static Tangent metricWeights() { return Base::metricWeights(); }
  static S injectivityRadius() { return Base::injectivityRadius(); }
  static S maxSectionalCurvature() { return Base::maxSectionalCurvature(); }
  static Square hessianHalfSquaredDistance(const Tangent& z) { return Base::hessianHalfSquaredDistance(z); }
};
