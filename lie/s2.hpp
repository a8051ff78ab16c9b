// S2: the unit sphere of R^3, directions.
//
// Storage        x y z, unit norm
// Tangent        two coordinates (rad) in the frame that the placement carries to the point; exp is the great circle
// Action         of SO3 from the left
// Origin         (0, 0, 1)
// Placement      the rotation of least angle from the origin to the point: smooth but at (0, 0, -1). No continuous
//                placement exists on a sphere: tangent vectors and covariances belong to this one.
// Metric         distance = angle, sectional curvature 1, injectivity radius pi
// Bad input      NaN in, NaN out; the constructor normalises, a zero vector gives NaN
#pragma once

#include <lie/so3.hpp>

namespace liestat {
namespace detail {

/// Parameters of the sphere.
template <class S>
struct S2Math {
  static constexpr int DoF = 2, num_parameters = 3;
  static Eigen::Matrix<S, 3, 1> identity() { return Eigen::Matrix<S, 3, 1>(S(0), S(0), S(1)); }
};

}  // namespace detail

/// Interface of S2 over owned or viewed memory.
template <class Derived>
class S2Base : public detail::Shell<Derived> {
 public:
  using Scalar = typename detail::Shell<Derived>::Scalar;
  /// The unit vector, viewed in place.
  Eigen::Map<const Eigen::Matrix<Scalar, 3, 1>> unit_vector() const {
    return Eigen::Map<const Eigen::Matrix<Scalar, 3, 1>>(this->data());
  }
};

template <class Scalar_, int Options_ = 0>
class S2;

using S2d = S2<double>;
using S2f = S2<float>;

}  // namespace liestat

LIESTAT_TRAITS(S2, liestat::detail::S2Math)

namespace liestat {

/// A direction of R^3; see the header comment.
template <class Scalar_, int Options_>
class S2 : public S2Base<S2<Scalar_, Options_>> {
  LIESTAT_OWNER(S2, S2Base);

 public:
  /// The direction of a vector of any positive length.
  explicit S2(const Eigen::Matrix<Scalar_, 3, 1>& v) : storage_(v) {
    using std::sqrt;
    storage_ /= sqrt(v.dot(v));
  }
  S2(const Scalar_& x, const Scalar_& y, const Scalar_& z) : S2(Eigen::Matrix<Scalar_, 3, 1>(x, y, z)) {}
};

/// The sphere under its round metric and SO(3).
template <class S, int O>
struct ManifoldTraits<S2<S, O>> {
  using M = S2<S, O>;
  using Group = SO3<S>;
  using Scalar = S;
  static constexpr int DoF = 2;
  using Tangent = Eigen::Matrix<S, 2, 1>;
  using Square = Eigen::Matrix<S, 2, 2>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  static M origin() { return M(); }
  static M act(const Group& f, const M& x) { return M::fromParams(f * Vector3(x.params())); }
  /// Rotation of least angle from (0, 0, 1) to x; the half-turn about x at the antipode.
  static Group placement(const M& x) {
    using detail::select;
    const auto& p = x.params();
    const S s2 = p[0] * p[0] + p[1] * p[1];
    // 1 + z without cancellation near the antipode: s²/(1 - z) below the equator.
    const auto lower = p[2] < S(0);
    const S w = select(lower, S(s2 / (S(1) - select(lower, p[2], S(0)))), S(S(1) + p[2]));
    const auto antipode = !(s2 + w * w > S(0));
    Eigen::Matrix<S, 4, 1> q(select(antipode, S(1), S(-p[1])), p[0], S(0), w);
    return Group::fromParams(detail::So3Math<S>::normalized(q));
  }
  static M expOrigin(const Tangent& v) {
    const detail::HalfAngle<S> h = detail::halfAngle(S(v.dot(v)));
    const S sinc = h.sinc * h.cos;
    return M::fromParams(Vector3(sinc * v[0], sinc * v[1], S(1) - S(0.5) * v.dot(v) * h.sinc * h.sinc));
  }
  /// (pi, 0) at the antipode.
  static Tangent logOrigin(const M& x) {
    using detail::select;
    const auto& p = x.params();
    const S s2 = p[0] * p[0] + p[1] * p[1];
    const auto antipode = s2 == S(0) && p[2] < S(0);
    const S f = detail::arctangentOverSine(select(antipode, S(1), s2), select(antipode, S(0), S(p[2])));
    return Tangent(select(antipode, S(EIGEN_PI), S(f * p[0])), f * p[1]);
  }
  /// n nᵀ + a (I - n nᵀ) with a = 1 + |v|² b: regular at zero, for b is.
  static Square radial(const Tangent& v, const S& b) {
    Square m = S(-b) * v * v.transpose();
    m.diagonal().array() += S(1) + b * v.dot(v);
    return m;
  }
  /// Across v by sin θ/θ = 1 - θ² beta3(θ²).
  static Square dexpOrigin(const Tangent& v) { return radial(v, S(-detail::beta3(S(v.dot(v))))); }
  /// Across z by θ/sin θ = 1 + θ² beta3(θ²)·θ/sin θ.
  static Square dlogOrigin(const M& x) {
    const Tangent z = logOrigin(x);
    const S t = z.dot(z);
    const detail::HalfAngle<S> h = detail::halfAngle(t);
    return radial(z, S(detail::beta3(t) / (h.sinc * h.cos)));
  }
  /// Rotation of the tangent plane that f makes beyond carrying the frame from x to f x.
  static Square isotropy(const Group& f, const M& x) {
    const Group h = placement(act(f, x)).inverse() * f * placement(x);
    return h.matrix().template topLeftCorner<2, 2>();
  }
  /// Exp(d) moves (0, 0, 1) by (d_y, -d_x).
  static Eigen::Matrix<S, 2, 3> originProjection() {
    Eigen::Matrix<S, 2, 3> m;
    m << S(0), S(1), S(0), S(-1), S(0), S(0);
    return m;
  }
  /// Body rotation of the placement along v: (-v_y, v_x, (y v_x - x v_y)/(1 + z)).
  static Eigen::Matrix<S, 3, 2> placementJacobian(const M& x) {
    using detail::select;
    const auto& p = x.params();
    const S s2 = p[0] * p[0] + p[1] * p[1];
    // As in placement: 1 + z without cancellation.
    const auto lower = p[2] < S(0);
    const S inverse = select(lower, S((S(1) - p[2]) / select(s2 > S(0), s2, S(1))),  //
                             S(S(1) / (S(1) + select(lower, S(0), S(p[2])))));
    Eigen::Matrix<S, 3, 2> m;
    m << S(0), S(-1), S(1), S(0), p[1] * inverse, -p[0] * inverse;
    return m;
  }
  /// Everywhere but at the antipode of the origin.
  static bool isPlacementSmooth(const M& x) {
    const auto& p = x.params();
    return p[2] > S(0) || p[0] * p[0] + p[1] * p[1] > S(0);
  }

  static Tangent metricWeights() { return Tangent::Ones(); }
  static S injectivityRadius() { return S(EIGEN_PI); }
  static S maxSectionalCurvature() { return S(1); }
  /// n nᵀ + θ cot θ (I - n nᵀ): negative across z beyond pi/2.
  static Square hessianHalfSquaredDistance(const Tangent& z) {
    // (1 - θ cot θ)/θ² is four times that of the half angle 2θ/2.
    return radial(z, S(S(-4) * detail::cotangentExcess(S(S(4) * z.dot(z)))));
  }
  /// log(sin θ/θ), the density of the area in the exponential chart, with its gradient and Hessian.
  static detail::VolumeElement<S, 2> logVolume(const Tangent& z) {
    using std::log;
    const S t = z.dot(z), c = S(-4) * detail::cotangentExcess(S(S(4) * t));
    const detail::HalfAngle<S> h = detail::halfAngle(t);
    return {log(h.sinc * h.cos), c * z,
            c * Square::Identity() - S(16) * detail::cotangentExcessSlope(S(S(4) * t)) * z * z.transpose()};
  }

  using ChordalMoments = detail::DirectionMoments<M>;
  static constexpr CompactFactor compact_factor = CompactFactor::sphere;
  static constexpr int compact_begin = 0;
  static Vector3 compactCoordinates(const M& x) { return x.params(); }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::direction, 0, 2}};
};

}  // namespace liestat

LIESTAT_MAPS(S2, liestat::S2Base)
