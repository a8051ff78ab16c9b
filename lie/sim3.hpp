// Sim3: similarities of R^3, s R p + t.
//
// Storage        x y z w of a quaternion whose squared norm is the scale s, then tx ty tz (Sophus' layout)
// Tangent        (translation m, rotation vector rad, logarithm of the scale), body frame: x·Exp(v)
// Matrix form    4×4 homogeneous matrix; hat(υ, ω, σ) = [[ω] + σ, υ; 0 0]
// Action         on points of R^3: s R p + t
// Identity       (0, 0, 0, 1, 0, 0, 0)
// Scale          saturates at 1e-10 and 1e10 (float: 1e-5 and 1e5), as in Sophus
// Metric         none that is bi-invariant: means by groupMean or MAHA
// Bad input      NaN in, NaN out
#pragma once

#include <lie/detail/similarity_series.hpp>
#include <lie/rxso3.hpp>

namespace liestat {
namespace detail {

/// Mathematics of Sim(3) on (quaternion, translation); tangent (υ, ω, σ).
template <class S>
struct Sim3Math {
  using Scalar = S;
  using Linear = RxSo3Math<S>;
  static constexpr int DoF = 7, num_parameters = 7, N = 4, Dim = 3;
  using Params = Eigen::Matrix<S, 7, 1>;
  using Tangent = Eigen::Matrix<S, 7, 1>;
  using Point = Eigen::Matrix<S, 3, 1>;
  using MatrixType = Eigen::Matrix<S, 4, 4>;
  using Square = Eigen::Matrix<S, 7, 7>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Vector4 = Eigen::Matrix<S, 4, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;

  static Params join(const Vector4& q, const Vector3& t) {
    Params p;
    p << q, t;
    return p;
  }
  static Vector4 quaternion(const Params& p) { return p.template head<4>(); }
  static Vector3 translation(const Params& p) { return p.template tail<3>(); }

  static Params identity() { return join(Linear::identity(), Vector3::Zero()); }
  static Params product(const Params& a, const Params& b) {
    return join(Linear::product(quaternion(a), quaternion(b)), act(a, translation(b)));
  }
  static Params inverse(const Params& p) {
    const Vector4 q = Linear::inverse(quaternion(p));
    return join(q, -Linear::act(q, translation(p)));
  }
  static Params normalized(const Params& p) { return p; }
  static S scale(const Params& p) { return Linear::scale(quaternion(p)); }
  static Point act(const Params& p, const Point& x) { return Linear::act(quaternion(p), x) + translation(p); }
  static Point linear(const Params& p, const Point& x) { return Linear::act(quaternion(p), x); }
  static Point rotate(const Params& p, const Point& x) { return Linear::rotate(quaternion(p), x); }

  static Params exp(const Tangent& v) {
    const Vector3 omega = v.template segment<3>(3);
    const S sigma = saturatedLogarithm(v[6]);
    const Axial<S> W = similarityIntegrals<Axial<S>>(sigma, S(omega.dot(omega))).phi;
    return join(Linear::exp(v.template tail<4>()), W.apply(omega, v.template head<3>()));
  }
  static Tangent log(const Params& p) {
    const Vector4 l = Linear::log(quaternion(p));
    const Vector3 omega = l.template head<3>();
    const S t = omega.dot(omega);
    Tangent v;
    v << Axial<S>::inverse(similarityIntegrals<Axial<S>>(l[3], t).phi, t).apply(omega, translation(p)), l;
    return v;
  }
  static MatrixType matrix(const Params& p) {
    MatrixType m = MatrixType::Identity();
    m.template topLeftCorner<3, 3>() = Linear::matrix(quaternion(p));
    m.template topRightCorner<3, 1>() = translation(p);
    return m;
  }
  static MatrixType hat(const Tangent& v) {
    MatrixType m = MatrixType::Zero();
    m.template topLeftCorner<3, 3>() = Linear::hat(v.template tail<4>());
    m.template topRightCorner<3, 1>() = v.template head<3>();
    return m;
  }
  static Tangent vee(const MatrixType& m) {
    Tangent v;
    v << m.template topRightCorner<3, 1>(), Linear::vee(m.template topLeftCorner<3, 3>());
    return v;
  }
  /// (A, B, c; 0, D, 0; 0, 0, corner)
  static Square blocks(const Matrix3& A, const Matrix3& B, const Vector3& c, const Matrix3& D, const S& corner) {
    Square m = Square::Zero();
    m.template topLeftCorner<3, 3>() = A;
    m.template block<3, 3>(0, 3) = B;
    m.template topRightCorner<3, 1>() = c;
    m.template block<3, 3>(3, 3) = D;
    m(6, 6) = corner;
    return m;
  }
  static Square Adj(const Params& p) {
    const Matrix3 R = Linear::Rotation::matrix(Linear::rotation(quaternion(p)));
    const Vector3 t = translation(p);
    return blocks(Linear::matrix(quaternion(p)), skew(t) * R, -t, R, S(1));
  }
  static Square ad(const Tangent& v) {
    const Vector3 upsilon = v.template head<3>();
    return blocks(Linear::hat(v.template tail<4>()), skew(upsilon), -upsilon, skew(v.template segment<3>(3)), S(0));
  }
  static Square leftJacobian(const Tangent& v) {
    const Vector3 upsilon = v.template head<3>(), omega = v.template segment<3>(3);
    const S t = omega.dot(omega);
    const auto w = similarityIntegrals<Axial<S>>(v[6], t);
    return blocks(w.phi.matrix(omega), similarityCoupling(v[6], t).matrix(omega, upsilon), -w.psi.apply(omega, upsilon),
                  Linear::Rotation::leftJacobian(omega), S(1));
  }
  static Square leftJacobianInverse(const Tangent& v) {
    const Vector3 upsilon = v.template head<3>(), omega = v.template segment<3>(3);
    const S t = omega.dot(omega);
    const auto w = similarityIntegrals<Axial<S>>(v[6], t);
    const Axial<S> inverse = Axial<S>::inverse(w.phi, t);
    const Matrix3 A = inverse.matrix(omega), D = Linear::Rotation::leftJacobianInverse(omega);
    return blocks(A, -A * similarityCoupling(v[6], t).matrix(omega, upsilon) * D,
                  Axial<S>::product(inverse, w.psi, t).apply(omega, upsilon), D, S(1));
  }
  static Square productJacobian(const Params& p) {
    Square J;
    J << Eigen::Matrix<S, 4, 3>::Zero(), Linear::productJacobian(quaternion(p)), Linear::matrix(quaternion(p)),
        Eigen::Matrix<S, 3, 4>::Zero();
    return J;
  }
  static Square quotientJacobian(const Params& p) {
    Square J;
    J << Eigen::Matrix<S, 3, 4>::Zero(), Linear::matrix(Linear::inverse(quaternion(p))),
        Linear::quotientJacobian(quaternion(p)), Eigen::Matrix<S, 4, 3>::Zero();
    return J;
  }
  template <class Generator>
  static Params sampleUniform(Generator& generator) {
    const Vector4 q = Linear::sampleUniform(generator);
    return join(q, uniformInCube<S, 3>(generator));
  }
};

}  // namespace detail

/// Interface of Sim3 over owned or viewed memory.
template <class Derived>
class Sim3Base : public detail::TranslationAccess<Derived, detail::GroupBase<Derived>, 3, 4> {
  using Base = detail::GroupBase<Derived>;

 public:
  using Base::data;
  using typename Base::Math, typename Base::Scalar;
  using Base::operator*;
  template <class Other>
  using Sim3Product = typename Base::template GroupProduct<Other>;
  using Quaternion = Eigen::Quaternion<Scalar>;
  using Matrix3 = Eigen::Matrix<Scalar, 3, 3>;

  /// Scale and rotation, viewed in place.
  Eigen::Map<const RxSO3<Scalar>> rxso3() const { return Eigen::Map<const RxSO3<Scalar>>(data()); }
  detail::PartView<Derived, RxSO3<Scalar>> rxso3() { return detail::PartView<Derived, RxSO3<Scalar>>(data()); }
  /// The quaternion, viewed in place; its squared norm is the scale.
  Eigen::Map<const Quaternion> quaternion() const { return Eigen::Map<const Quaternion>(data()); }
  Scalar scale() const { return Math::scale(this->params()); }
  SO3<Scalar> so3() const { return rxso3().so3(); }
  /// The rotation without its scale.
  Matrix3 rotationMatrix() const { return rxso3().rotationMatrix(); }
  /// The first three rows of matrix().
  Eigen::Matrix<Scalar, 3, 4> matrix3x4() const { return this->matrix().template topRows<3>(); }

  /// Replaces scale and rotation, from a quaternion other than zero or a scaled rotation matrix.
  void setQuaternion(const Quaternion& q) { rxso3().setQuaternion(q); }
  void setScaledRotationMatrix(const Matrix3& sR) { rxso3().setScaledRotationMatrix(sR); }
  /// Replaces the scale, s > 0, or the rotation, and leaves the other.
  void setScale(const Scalar& s) { rxso3().setScale(s); }
  void setRotationMatrix(const Matrix3& R) { rxso3().setRotationMatrix(R); }
};

template <class Scalar_, int Options_ = 0>
class Sim3;

using Sim3d = Sim3<double>;
using Sim3f = Sim3<float>;

}  // namespace liestat

LIESTAT_TRAITS(Sim3, liestat::detail::Sim3Math)

namespace liestat {

/// A similarity of R^3; see the header comment.
template <class Scalar_, int Options_>
class Sim3 : public Sim3Base<Sim3<Scalar_, Options_>> {
  LIESTAT_OWNER(Sim3, Sim3Base);

 public:
  using Vector3 = Eigen::Matrix<Scalar_, 3, 1>;

  template <class D>
  Sim3(const RxSO3Base<D>& rxso3, const Vector3& translation)
      : storage_(Shell::Math::join(rxso3.params(), translation)) {}
  /// From a quaternion other than zero, whose squared norm is the scale, and a translation (m).
  template <class D>
  Sim3(const Eigen::QuaternionBase<D>& q, const Vector3& translation)
      : storage_(Shell::Math::join(q.coeffs(), translation)) {}
  /// From a scale s > 0, a quaternion of any positive norm, which is normalised, and a translation (m).
  template <class D>
  Sim3(const Scalar_& scale, const Eigen::QuaternionBase<D>& q, const Vector3& translation)
      : Sim3(RxSO3<Scalar_>(scale, q), translation) {}
  /// From a homogeneous matrix with a scaled rotation.
  explicit Sim3(const Eigen::Matrix<Scalar_, 4, 4>& T)
      : Sim3(RxSO3<Scalar_>(T.template topLeftCorner<3, 3>()), Vector3(T.template topRightCorner<3, 1>())) {}
};

/// Sim(3) is homogeneous under itself, not Metric.
template <class S, int O>
struct ManifoldTraits<Sim3<S, O>> : GroupManifold<Sim3<S, O>> {
  static constexpr TangentBlock tangent_parts[] = {
      {TangentPart::translation, 0, 3}, {TangentPart::rotation, 3, 3}, {TangentPart::log_scale, 6, 1}};
};

}  // namespace liestat

LIESTAT_MAPS(Sim3, liestat::Sim3Base)
