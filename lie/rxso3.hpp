// RxSO3: rotations with a scale in R^3, s R, as quaternions other than zero.
//
// Storage        x y z w of a quaternion whose squared norm is the scale s (Sophus' layout)
// Tangent        (rotation vector rad, logarithm of the scale), body frame: x·Exp(v)
// Matrix form    3×3 matrix s R; hat(ω, σ) = [ω] + σ
// Action         on points of R^3: s R p
// Identity       (0, 0, 0, 1)
// Scale          saturates at 1e-10 and 1e10 (float: 1e-5 and 1e5), as in Sophus
// Metric         the bi-invariant product: distance² = angle² + (difference of the logarithms)²
// Bad input      NaN in, NaN out
#pragma once

#include <lie/detail/scale.hpp>
#include <lie/so3.hpp>

namespace liestat {
namespace detail {

/// Mathematics of R⁺ × SO(3) on quaternions (x, y, z, w).
template <class S>
struct RxSo3Math {
  using Scalar = S;
  using Rotation = So3Math<S>;
  static constexpr int DoF = 4, num_parameters = 4, N = 3, Dim = 3;
  using Params = Eigen::Matrix<S, 4, 1>;
  using Tangent = Eigen::Matrix<S, 4, 1>;
  using Point = Eigen::Matrix<S, 3, 1>;
  using MatrixType = Eigen::Matrix<S, 3, 3>;
  using Square = Eigen::Matrix<S, 4, 4>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  static Params identity() { return Rotation::identity(); }
  /// Product of quaternions, its scale kept in the admitted range.
  static Params product(const Params& a, const Params& b) {
    const Params q = Rotation::quaternionProduct(a, b);
    return saturated(q, S(q.dot(q)), ScaleRange<S>::least);
  }
  static Params inverse(const Params& q) { return Rotation::inverse(q) / q.dot(q); }
  /// All quaternions but zero are elements.
  static Params normalized(const Params& q) { return q; }
  static S scale(const Params& q) { return q.dot(q); }
  static Params rotation(const Params& q) { return Rotation::normalized(q); }
  static Point act(const Params& q, const Point& p) {
    const Vector3 u = q.template head<3>();
    const Vector3 t = S(2) * u.cross(p);
    return scale(q) * p + q[3] * t + u.cross(t);
  }
  static Point linear(const Params& q, const Point& p) { return act(q, p); }
  static Point rotate(const Params& q, const Point& p) { return act(q, p) / scale(q); }
  /// s R, without a division.
  static MatrixType matrix(const Params& q) {
    const S xx = q[0] * q[0], yy = q[1] * q[1], zz = q[2] * q[2], ww = q[3] * q[3];
    const S xy = S(2) * q[0] * q[1], xz = S(2) * q[0] * q[2], yz = S(2) * q[1] * q[2];
    const S xw = S(2) * q[0] * q[3], yw = S(2) * q[1] * q[3], zw = S(2) * q[2] * q[3];
    MatrixType m;
    m << ww + xx - yy - zz, xy - zw, xz + yw,  //
        xy + zw, ww + yy - xx - zz, yz - xw,   //
        xz - yw, yz + xw, ww + zz - xx - yy;
    return m;
  }
  /// The quaternion of a multiple of a rotation matrix.
  static Params fromMatrix(const MatrixType& sR) {
    using std::sqrt;
    const S s = sqrt(sR.squaredNorm() / S(3));
    return sqrt(s) * Rotation::normalized(quaternionOf<S>(sR / s));
  }

  static Params exp(const Tangent& v) {
    using std::exp;
    return exp(S(0.5) * saturatedLogarithm(v[3])) * Rotation::exp(v.template head<3>());
  }
  static Tangent log(const Params& q) {
    using std::log;
    const Vector3 omega = Rotation::log(q);
    return Tangent(omega[0], omega[1], omega[2], log(scale(q)));
  }
  static MatrixType hat(const Tangent& v) {
    MatrixType m = skew(v.template head<3>());
    m.diagonal().array() += v[3];
    return m;
  }
  static Tangent vee(const MatrixType& m) { return Tangent(m(2, 1), m(0, 2), m(1, 0), m(0, 0)); }
  /// diag(A, 1)
  static Square block(const MatrixType& A, const S& corner) {
    Square m;
    m << A, Vector3::Zero(), Vector3::Zero().transpose(), corner;
    return m;
  }
  static Square Adj(const Params& q) { return block(Rotation::matrix(rotation(q)), S(1)); }
  static Square ad(const Tangent& v) { return block(skew(v.template head<3>()), S(0)); }
  static Square leftJacobian(const Tangent& v) { return block(Rotation::leftJacobian(v.template head<3>()), S(1)); }
  static Square leftJacobianInverse(const Tangent& v) {
    return block(Rotation::leftJacobianInverse(v.template head<3>()), S(1));
  }
  static Square productJacobian(const Params& q) {
    Square J;
    J << Rotation::productJacobian(q), S(0.5) * q;
    return J;
  }
  static Square quotientJacobian(const Params& q) { return (S(4) / scale(q)) * productJacobian(q).transpose(); }
  template <class Generator>
  static Params sampleUniform(Generator& generator) {
    using std::sqrt;
    const S s = sqrt(uniformScale<S>(generator));
    return s * Rotation::sampleUniform(generator);
  }
};

}  // namespace detail

/// Interface of RxSO3 over owned or viewed memory.
template <class Derived>
class RxSO3Base : public detail::GroupBase<Derived> {
  using Base = detail::GroupBase<Derived>;

 public:
  using typename Base::Math, typename Base::Plain, typename Base::Scalar, typename Base::Tangent;
  using Base::operator*;
  template <class Other>
  using RxSO3Product = typename Base::template GroupProduct<Other>;
  using Quaternion = Eigen::Quaternion<Scalar>;
  using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;

  /// A tangent vector and the norm of its rotation part (rad).
  struct TangentAndTheta {
    Tangent tangent;
    Scalar theta;
  };
  TangentAndTheta logAndTheta() const {
    const Tangent v = this->log();
    return {v, detail::norm(v.template head<3>())};
  }
  /// exp(v); *theta becomes the norm of v's rotation part.
  static Plain expAndTheta(const Tangent& v, Scalar* theta) {
    *theta = detail::norm(v.template head<3>());
    return Base::exp(v);
  }

  /// The quaternion, viewed in place; its squared norm is the scale.
  Eigen::Map<const Quaternion> quaternion() const { return Eigen::Map<const Quaternion>(this->data()); }
  Scalar scale() const { return Math::scale(this->params()); }
  SO3<Scalar> so3() const { return SO3<Scalar>::fromParams(Math::rotation(this->params())); }
  /// The rotation without its scale; matrix() has both.
  Matrix3 rotationMatrix() const { return so3().matrix(); }

  /// Replaces scale and rotation, from a quaternion other than zero or a scaled rotation matrix.
  void setQuaternion(const Quaternion& q) { this->derived().mutableStorage() = q.coeffs(); }
  void setScaledRotationMatrix(const Matrix3& sR) { this->derived().mutableStorage() = Math::fromMatrix(sR); }
  /// Replaces the scale, s > 0, and leaves the rotation.
  void setScale(const Scalar& s) {
    using std::sqrt;
    this->derived().mutableStorage() = (sqrt(s) * Math::rotation(this->params())).eval();
  }
  /// Replaces the rotation and leaves the scale.
  void setSO3(const SO3<Scalar>& rotation) {
    using std::sqrt;
    this->derived().mutableStorage() = (sqrt(scale()) * rotation.params()).eval();
  }
  void setRotationMatrix(const Matrix3& R) { setSO3(SO3<Scalar>(R)); }
};

template <class Scalar_, int Options_ = 0>
class RxSO3;

using RxSO3d = RxSO3<double>;
using RxSO3f = RxSO3<float>;

}  // namespace liestat

LIESTAT_TRAITS(RxSO3, liestat::detail::RxSo3Math)

namespace liestat {

/// A rotation of R^3 with a scale; see the header comment.
template <class Scalar_, int Options_>
class RxSO3 : public RxSO3Base<RxSO3<Scalar_, Options_>> {
  LIESTAT_OWNER(RxSO3, RxSO3Base);

 public:
  using Matrix3 = Eigen::Matrix<Scalar_, 3, 3>;

  /// From a quaternion other than zero; its squared norm is the scale.
  template <class D>
  explicit RxSO3(const Eigen::QuaternionBase<D>& q) : storage_(q.coeffs()) {}
  /// From a scaled rotation matrix.
  explicit RxSO3(const Matrix3& sR) : storage_(Shell::Math::fromMatrix(sR)) {}
  /// From a scale s > 0 and a rotation.
  template <class D>
  RxSO3(const Scalar_& scale, const SO3Base<D>& rotation) : storage_(rotation.params()) {
    this->setScale(scale);
  }
  RxSO3(const Scalar_& scale, const Matrix3& R) : RxSO3(scale, SO3<Scalar_>(R)) {}
  /// From a scale s > 0 and a quaternion of any positive norm, which is normalised.
  template <class D>
  RxSO3(const Scalar_& scale, const Eigen::QuaternionBase<D>& q) : RxSO3(scale, SO3<Scalar_>(q)) {}
};

/// R⁺ × SO(3) under its bi-invariant metric.
template <class S, int O>
struct ManifoldTraits<RxSO3<S, O>> : GroupManifold<RxSO3<S, O>> {
  using Math = detail::RxSo3Math<S>;
  using Rotation = ManifoldTraits<SO3<S>>;
  using Tangent = Eigen::Matrix<S, 4, 1>;
  using Square = Eigen::Matrix<S, 4, 4>;

  static Tangent metricWeights() { return Tangent::Ones(); }
  static S injectivityRadius() { return S(EIGEN_PI); }
  static S maxSectionalCurvature() { return S(0.25); }
  static Square hessianHalfSquaredDistance(const Tangent& z) {
    return Math::block(Rotation::hessianHalfSquaredDistance(z.template head<3>()), S(1));
  }
  static Square dlogFeatureTransposed(const Tangent& z, const Tangent& a) {
    return Math::block(Rotation::dlogFeatureTransposed(z.template head<3>(), a.template head<3>()), S(0));
  }
  static Square dlogBaseTransposed(const Tangent& z, const Tangent& a) {
    return Math::block(Rotation::dlogBaseTransposed(z.template head<3>(), a.template head<3>()), S(0));
  }
  static detail::VolumeElement<S, 4> logVolume(const Tangent& z) {
    const detail::VolumeElement<S, 3> rotation = Rotation::logVolume(z.template head<3>());
    detail::VolumeElement<S, 4> v;
    v.value = rotation.value;
    v.gradient.template head<3>() = rotation.gradient;
    v.hessian.template topLeftCorner<3, 3>() = rotation.hessian;
    return v;
  }

  static constexpr CompactFactor compact_factor = CompactFactor::rotation;
  static constexpr int compact_begin = 0;
  static Eigen::Matrix<S, 4, 1> compactCoordinates(const RxSO3<S, O>& x) { return x.params().normalized(); }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::rotation, 0, 3}, {TangentPart::log_scale, 3, 1}};
};

}  // namespace liestat

LIESTAT_MAPS(RxSO3, liestat::RxSO3Base)
