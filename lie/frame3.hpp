// Frame3: a point of R^3 with an orthonormal trihedron (a pose), as a Riemannian manifold under SE(3).
//
// Storage        qx qy qz qw tx ty tz, the same data as SE3
// Tangent        (translation m, rotation rad), in the frame: exp(x, v) = (t + R v_t, R·Exp(v_r))
// Action         of SE3 from the left
// Origin         the identity
// Metric         d² = |translation|² + rotation angle², left-invariant; sectional curvature at most 1/4,
//                injectivity radius pi in the rotation. Its mean is (mean rotation, arithmetic mean of translations).
//                SE3 has another exponential (the screw) and no such metric.
// Bad input      NaN in, NaN out
// Source         Pennec 1998, sections 2 and 5
#pragma once

#include <lie/se3.hpp>

namespace liestat {

/// Interface of the frames over owned or viewed memory.
template <class Derived>
class Frame3Base : public detail::PoseAccess<Derived, detail::Shell<Derived>> {
 public:
  using Scalar = typename detail::Shell<Derived>::Scalar;
  /// The same data as a rigid motion: the transformation that places the frame.
  SE3<Scalar> se3() const { return SE3<Scalar>::fromParams(this->params()); }
};

template <class Scalar_, int Options_ = 0>
class Frame3;

using Frame3d = Frame3<double>;
using Frame3f = Frame3<float>;

}  // namespace liestat

LIESTAT_TRAITS(Frame3, liestat::detail::Se3Math)

namespace liestat {

/// A frame of R^3; see the header comment.
template <class Scalar_, int Options_>
class Frame3 : public Frame3Base<Frame3<Scalar_, Options_>> {
  LIESTAT_OWNER(Frame3, Frame3Base);

 public:
  using Vector3 = Eigen::Matrix<Scalar_, 3, 1>;

  template <class D>
  Frame3(const SE3Base<D>& pose) : storage_(pose.params()) {}  // NOLINT: the casts between SE3 and Frame3 are free
  template <class D>
  Frame3(const SO3Base<D>& rotation, const Vector3& translation)
      : storage_(Shell::Math::join(rotation.params(), translation)) {}
  template <class D>
  Frame3(const Eigen::QuaternionBase<D>& q, const Vector3& translation) : Frame3(SO3<Scalar_>(q), translation) {}
};

namespace detail {

/// Exponential map of the product metric on (quaternion, translation) and its derivatives; Σ in the order (t, r).
template <class S>
struct FrameMath {
  using Pose = Se3Math<S>;
  using Rotation = So3Math<S>;
  using Params = typename Pose::Params;
  using Tangent = typename Pose::Tangent;
  using Square = typename Pose::Square;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;

  static Params exp(const Tangent& v) { return Pose::join(Rotation::exp(v.template tail<3>()), v.template head<3>()); }
  static Tangent log(const Params& p) {
    Tangent v;
    v << Pose::translation(p), Rotation::log(Pose::quaternion(p));
    return v;
  }
  static Square diagonal(const Matrix3& translation, const Matrix3& rotation) {
    Square m;
    m << translation, Matrix3::Zero(), Matrix3::Zero(), rotation;
    return m;
  }
  /// diag(R(z), J_r⁻¹(z)): D of docs/theory/means.md, section 2.
  static Square dlog(const Vector3& z_r) {
    return diagonal(Rotation::matrix(Rotation::exp(z_r)), Rotation::leftJacobianInverse(Vector3(-z_r)));
  }
  static Square dexp(const Tangent& v) {
    const Vector3 r = v.template tail<3>();
    return diagonal(Rotation::matrix(Rotation::exp(r)).transpose(), Rotation::leftJacobian(Vector3(-r)));
  }
  static Square hessianHalfSquaredDistance(const Tangent& z) {
    const Vector3 r = z.template tail<3>();
    return diagonal(Matrix3::Identity(), rotationPolynomial(r, S(1), S(0), cotangentExcess(S(r.dot(r)))));
  }
  static VolumeElement<S, 6> logVolume(const Tangent& z) {
    const VolumeElement<S, 3> rotation = Rotation::logVolume(z.template tail<3>());
    VolumeElement<S, 6> v;
    v.value = rotation.value;
    v.gradient.template tail<3>() = rotation.gradient;
    v.hessian.template bottomRightCorner<3, 3>() = rotation.hessian;
    return v;
  }
  /// ∂(D(z)ᵀ a)/∂z, a constant.
  static Square dlogFeatureTransposed(const Tangent& z, const Tangent& a) {
    const Vector3 r = z.template tail<3>(), a_t = a.template head<3>(), a_r = a.template tail<3>();
    const Vector3 turned = Rotation::matrix(Rotation::exp(r)).transpose() * a_t;
    Square m = Square::Zero();
    m.template topRightCorner<3, 3>() = skew(turned) * Rotation::leftJacobian(Vector3(-r));
    m.template bottomRightCorner<3, 3>() = Rotation::inverseJacobianSlope(r, a_r, S(-1));
    return m;
  }
  /// ∂(L(z)ᵀ a)/∂z, a constant, L = ∂z/∂(base).
  static Square dlogBaseTransposed(const Tangent& z, const Tangent& a) {
    const Vector3 r = z.template tail<3>(), a_t = a.template head<3>(), a_r = a.template tail<3>();
    Square m = Square::Zero();
    m.template bottomLeftCorner<3, 3>() = skew(a_t);
    m.template bottomRightCorner<3, 3>() = -Rotation::inverseJacobianSlope(r, a_r, S(1));
    return m;
  }
};

/// Traits common to the frame and its two quotients.
template <class M>
struct FrameManifold : TrivialIsotropy<M, SE3<typename M::Scalar>> {
  using Base = TrivialIsotropy<M, SE3<typename M::Scalar>>;
  using typename Base::Group, typename Base::Scalar, typename Base::Tangent, typename Base::Square;
  using Math = FrameMath<Scalar>;

  static M act(const Group& f, const M& x) { return M::fromParams(Se3Math<Scalar>::product(f.params(), x.params())); }
  static Group placement(const M& x) { return Group::fromParams(x.params()); }
  static M expOrigin(const Tangent& v) { return M::fromParams(Math::exp(v)); }
  static Square dexpOrigin(const Tangent& v) { return Math::dexp(v); }
  static Tangent metricWeights() { return Tangent::Ones(); }
  static Scalar maxSectionalCurvature() { return Scalar(0.25); }
  static Square hessianHalfSquaredDistance(const Tangent& z) { return Math::hessianHalfSquaredDistance(z); }
  static Square dlogFeatureTransposed(const Tangent& z, const Tangent& a) { return Math::dlogFeatureTransposed(z, a); }
  static Square dlogBaseTransposed(const Tangent& z, const Tangent& a) { return Math::dlogBaseTransposed(z, a); }
  static VolumeElement<Scalar, 6> logVolume(const Tangent& z) { return Math::logVolume(z); }

  static constexpr CompactFactor compact_factor = CompactFactor::rotation;
  static constexpr int compact_begin = 3;
  static Eigen::Matrix<Scalar, 4, 1> compactCoordinates(const M& x) { return x.params().template head<4>(); }
  static const Scalar* parameters(const M& x) { return x.data(); }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::translation, 0, 3}, {TangentPart::rotation, 3, 3}};
};

}  // namespace detail

/// The frame under the product metric.
template <class S, int O>
struct ManifoldTraits<Frame3<S, O>> : detail::FrameManifold<Frame3<S, O>> {
  using Base = detail::FrameManifold<Frame3<S, O>>;
  using typename Base::Tangent, typename Base::Square;

  static Tangent logOrigin(const Frame3<S, O>& x) { return detail::FrameMath<S>::log(x.params()); }
  static Square dlogOrigin(const Frame3<S, O>& x) {
    return detail::FrameMath<S>::dlog(detail::So3Math<S>::log(x.params().template head<4>()));
  }
  static S injectivityRadius() { return S(EIGEN_PI); }

  using ChordalMoments = detail::QuaternionMoments<Frame3<S, O>>;
};

}  // namespace liestat

LIESTAT_MAPS(Frame3, liestat::Frame3Base)
