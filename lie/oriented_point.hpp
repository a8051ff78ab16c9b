// OrientedPoint: a point of R^3 with a direction, such as a point of a surface with its normal, or of a curve with its
// tangent.
//
// Storage        px py pz dx dy dz, the direction of unit norm
// Tangent        (position m, direction rad), 3 + 2 coordinates, along the axes that the placement carries to the
//                point: exp(x, v) = (p + R v_p, R·exp(v_d)), R the rotation of least angle from (0, 0, 1) to d
// Action         of SE3 from the left: (R p + t, R d)
// Origin         (0, 0, 0) with the direction (0, 0, 1)
// Placement      (R, p): smooth but at the direction (0, 0, -1). What leaves the origin is the turn about the
//                direction.
// Metric         d² = |position|² + angle of the directions², invariant; sectional curvature at most 1, injectivity
//                radius pi in the direction. Its mean is (arithmetic mean of positions, mean direction).
// Bad input      NaN in, NaN out; constructors normalise the direction, a zero vector gives NaN
#pragma once

#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se3.hpp>

#include <tuple>

namespace liestat {
namespace detail {

/// Parameters of the oriented point.
template <class S>
struct OrientedPointMath {
  static constexpr int DoF = 5, num_parameters = 6;
  using Params = Eigen::Matrix<S, 6, 1>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  static Params join(const Vector3& position, const Vector3& direction) {
    Params p;
    p << position, direction;
    return p;
  }
  static Params identity() { return join(Vector3::Zero(), S2Math<S>::identity()); }
};

}  // namespace detail

/// Interface of OrientedPoint over owned or viewed memory.
template <class Derived>
class OrientedPointBase : public detail::Shell<Derived> {
 public:
  using detail::Shell<Derived>::data;
  using Scalar = typename detail::Shell<Derived>::Scalar;
  using Vector3 = Eigen::Matrix<Scalar, 3, 1>;

  /// The position (m), viewed in place.
  Eigen::Map<const Vector3> position() const { return Eigen::Map<const Vector3>(data()); }
  detail::PartView<Derived, Vector3> position() { return detail::PartView<Derived, Vector3>(data()); }
  /// The direction, viewed in place.
  Eigen::Map<const S2<Scalar>> direction() const { return Eigen::Map<const S2<Scalar>>(data() + 3); }
  detail::PartView<Derived, S2<Scalar>> direction() { return detail::PartView<Derived, S2<Scalar>>(data() + 3); }

  /// Signed distance (m) of a point from the plane through this one with this one's direction as normal.
  Scalar planeDistance(const Vector3& point) const { return direction().unit_vector().dot(point - position()); }
  /// The point of the line through this one along its direction that is nearest to a given one.
  Vector3 projectOnLine(const Vector3& point) const {
    return position() + planeDistance(point) * direction().unit_vector();
  }
};

template <class Scalar_, int Options_ = 0>
class OrientedPoint;

using OrientedPointd = OrientedPoint<double>;
using OrientedPointf = OrientedPoint<float>;

}  // namespace liestat

LIESTAT_TRAITS(OrientedPoint, liestat::detail::OrientedPointMath)

namespace liestat {

/// A point of R^3 with a direction; see the header comment.
template <class Scalar_, int Options_>
class OrientedPoint : public OrientedPointBase<OrientedPoint<Scalar_, Options_>> {
  LIESTAT_OWNER(OrientedPoint, OrientedPointBase);

 public:
  using Vector3 = Eigen::Matrix<Scalar_, 3, 1>;

  template <class D>
  OrientedPoint(const Vector3& position, const S2Base<D>& direction)
      : storage_(Shell::Math::join(position, direction.params())) {}
  /// From a position and a vector of any positive length.
  OrientedPoint(const Vector3& position, const Vector3& direction) : OrientedPoint(position, S2<Scalar_>(direction)) {}
};

/// Points with a direction under the product metric and SE(3).
template <class S, int O>
struct ManifoldTraits<OrientedPoint<S, O>> {
  using M = OrientedPoint<S, O>;
  using Sphere = ManifoldTraits<S2<S>>;
  using Group = SE3<S>;
  using Scalar = S;
  static constexpr int DoF = 5;
  using Tangent = Eigen::Matrix<S, 5, 1>;
  using Square = Eigen::Matrix<S, 5, 5>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix2 = Eigen::Matrix<S, 2, 2>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;

  static M origin() { return M(); }
  static M act(const Group& f, const M& x) {
    return M::fromParams(M::Math::join(f * Vector3(x.position()), f.so3() * Vector3(x.direction().unit_vector())));
  }
  static Group placement(const M& x) { return Group(Sphere::placement(x.direction()), x.position()); }
  static M expOrigin(const Tangent& v) {
    return M::fromParams(M::Math::join(v.template head<3>(), Sphere::expOrigin(v.template tail<2>()).params()));
  }
  /// Direction (pi, 0) at the antipode.
  static Tangent logOrigin(const M& x) {
    Tangent v;
    v << x.position(), Sphere::logOrigin(x.direction());
    return v;
  }
  static Square diagonal(const Matrix3& position, const Matrix2& direction) {
    Square m = Square::Zero();
    m.template topLeftCorner<3, 3>() = position;
    m.template bottomRightCorner<2, 2>() = direction;
    return m;
  }
  static Square dexpOrigin(const Tangent& v) {
    const Eigen::Matrix<S, 2, 1> d = v.template tail<2>();
    return diagonal(Sphere::placement(Sphere::expOrigin(d)).matrix().transpose(), Sphere::dexpOrigin(d));
  }
  static Square dlogOrigin(const M& x) {
    return diagonal(Sphere::placement(x.direction()).matrix(), Sphere::dlogOrigin(x.direction()));
  }
  /// The turn about the direction that f makes beyond carrying the axes from x to f x.
  static Square isotropy(const Group& f, const M& x) {
    const S2<S> d = x.direction();
    const SO3<S> h = Sphere::placement(Sphere::act(f.so3(), d)).inverse() * f.so3() * Sphere::placement(d);
    const Matrix3 turn = h.matrix();
    return diagonal(turn, turn.template topLeftCorner<2, 2>());
  }
  static Eigen::Matrix<S, 5, 6> originProjection() {
    Eigen::Matrix<S, 5, 6> m = Eigen::Matrix<S, 5, 6>::Zero();
    m.template topLeftCorner<3, 3>().setIdentity();
    m.template bottomRightCorner<2, 3>() = Sphere::originProjection();
    return m;
  }
  static Eigen::Matrix<S, 6, 5> placementJacobian(const M& x) {
    Eigen::Matrix<S, 6, 5> m = Eigen::Matrix<S, 6, 5>::Zero();
    m.template topLeftCorner<3, 3>().setIdentity();
    m.template bottomRightCorner<3, 2>() = Sphere::placementJacobian(x.direction());
    return m;
  }
  /// Everywhere but at the direction opposite to the origin's.
  static bool isPlacementSmooth(const M& x) { return Sphere::isPlacementSmooth(x.direction()); }

  static Tangent metricWeights() { return Tangent::Ones(); }
  static S injectivityRadius() { return Sphere::injectivityRadius(); }
  static S maxSectionalCurvature() { return Sphere::maxSectionalCurvature(); }
  static Square hessianHalfSquaredDistance(const Tangent& z) {
    return diagonal(Matrix3::Identity(), Sphere::hessianHalfSquaredDistance(z.template tail<2>()));
  }
  /// That of the direction: positions are flat.
  static detail::VolumeElement<S, 5> logVolume(const Tangent& z) {
    const detail::VolumeElement<S, 2> direction = Sphere::logVolume(z.template tail<2>());
    detail::VolumeElement<S, 5> v;
    v.value = direction.value;
    v.gradient.template tail<2>() = direction.gradient;
    v.hessian.template bottomRightCorner<2, 2>() = direction.hessian;
    return v;
  }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::point, 0, 3}, {TangentPart::direction, 3, 2}};
  /// Position and direction, of which the squared distance is the sum.
  static std::tuple<Vector3, S2<S>> factors(const M& x) { return {x.position(), x.direction()}; }
  static M fromFactors(const std::tuple<Vector3, S2<S>>& f) { return M(std::get<0>(f), std::get<1>(f)); }
};

}  // namespace liestat

LIESTAT_MAPS(OrientedPoint, liestat::OrientedPointBase)
