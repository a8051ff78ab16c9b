// SE3: rigid motions of R^3 as a Lie group; the exponential is the screw motion.
//
// Storage        qx qy qz qw tx ty tz (Sophus' layout)
// Tangent        (translation m, rotation rad), body frame: x·Exp(v)
// Matrix form    4×4 homogeneous matrix; hat(v) = [[ω]× υ; 0 0]
// Action         on points of R^3: R p + t
// Identity       (0, 0, 0, 1, 0, 0, 0)
// Metric         none that is bi-invariant: means by groupMean or MAHA. For Riemannian statistics of poses use Frame3.
// Bad input      NaN in, NaN out; quaternions are normalised on construction
#pragma once

#include <lie/so3.hpp>

namespace liestat {
namespace detail {

/// Mathematics of SE(3) on (quaternion, translation); tangent (υ, ω).
template <class S>
struct Se3Math {
  using Scalar = S;
  using Rotation = So3Math<S>;
  static constexpr int DoF = 6, num_parameters = 7, N = 4, Dim = 3;
  using Params = Eigen::Matrix<S, 7, 1>;
  using Tangent = Eigen::Matrix<S, 6, 1>;
  using Point = Eigen::Matrix<S, 3, 1>;
  using MatrixType = Eigen::Matrix<S, 4, 4>;
  using Square = Eigen::Matrix<S, 6, 6>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Vector4 = Eigen::Matrix<S, 4, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;

  static Params join(const Vector4& q, const Vector3& t) {
    Params p;
    for (int i = 0; i < 4; ++i) p[i] = q[i];
    for (int i = 0; i < 3; ++i) p[i + 4] = t[i];
    return p;
  }
  static Vector4 quaternion(const Params& p) { return Vector4(p[0], p[1], p[2], p[3]); }
  static Vector3 translation(const Params& p) { return three<4>(p); }

  static Params identity() { return join(Rotation::identity(), Vector3::Zero()); }
  static Params product(const Params& a, const Params& b) {
    return join(Rotation::product(quaternion(a), quaternion(b)),
                Rotation::act(quaternion(a), translation(b), translation(a)));
  }
  static Params inverse(const Params& p) {
    const Vector4 q = Rotation::inverse(quaternion(p));
    return join(q, Rotation::act(q, Vector3(-p[4], -p[5], -p[6])));
  }
  static Params normalized(const Params& p) { return join(Rotation::normalized(quaternion(p)), translation(p)); }
  static Point act(const Params& p, const Point& x) { return Rotation::act(quaternion(p), x, translation(p)); }
  static Point linear(const Params& p, const Point& x) { return Rotation::act(quaternion(p), x); }
  static Point rotate(const Params& p, const Point& x) { return Rotation::act(quaternion(p), x); }

  static Params exp(const Tangent& v) {
    const Vector3 omega = three<3>(v), upsilon = three<0>(v);
    return join(Rotation::exp(omega), Rotation::leftJacobianTimes(omega, upsilon));
  }
  static Tangent log(const Params& p) {
    const typename Rotation::Logarithm l = Rotation::logarithm(quaternion(p));
    const Vector3 omega(l.scale * p[0], l.scale * p[1], l.scale * p[2]);
    const Vector3 upsilon = crossPolynomialTimes(omega, S(-0.5), arccosineExcess(l.w), translation(p));
    Tangent v;
    for (int i = 0; i < 3; ++i) {
      v[i] = upsilon[i];
      v[i + 3] = omega[i];
    }
    return v;
  }

  static MatrixType matrix(const Params& p) {
    MatrixType m;
    m.template topLeftCorner<3, 3>() = Rotation::matrix(quaternion(p));
    m.template topRightCorner<3, 1>() = translation(p);
    m.row(3) = Vector4::Unit(3).transpose();
    return m;
  }
  static MatrixType hat(const Tangent& v) {
    MatrixType m = MatrixType::Zero();
    m.template topLeftCorner<3, 3>() = skew(v.template tail<3>());
    m.template topRightCorner<3, 1>() = v.template head<3>();
    return m;
  }
  static Tangent vee(const MatrixType& m) {
    Tangent v;
    v << m.template topRightCorner<3, 1>(), Rotation::vee(m.template topLeftCorner<3, 3>());
    return v;
  }
  static EIGEN_ALWAYS_INLINE Square blocks(const Matrix3& diagonal, const Matrix3& coupling) {
    // Entry by entry: Eigen's copies in packets wait for the entries that were stored one by one.
    Square m;
    for (int j = 0; j < 3; ++j) {
      for (int i = 0; i < 3; ++i) {
        m(i, j) = m(i + 3, j + 3) = diagonal(i, j);
        m(i + 3, j) = S(0);
        m(i, j + 3) = coupling(i, j);
      }
    }
    return m;
  }
  static Square Adj(const Params& p) {
    const Matrix3 R = Rotation::matrix(quaternion(p));
    const S x = p[4], y = p[5], z = p[6];
    Square m;
    for (int j = 0; j < 3; ++j) {
      const S a = R(0, j), b = R(1, j), c = R(2, j);
      m(0, j) = m(3, j + 3) = a;
      m(1, j) = m(4, j + 3) = b;
      m(2, j) = m(5, j + 3) = c;
      m(3, j) = m(4, j) = m(5, j) = S(0);
      m(0, j + 3) = y * c - z * b;
      m(1, j + 3) = z * a - x * c;
      m(2, j + 3) = x * b - y * a;
    }
    return m;
  }
  static Square ad(const Tangent& v) { return blocks(skew(three<3>(v)), skew(three<0>(v))); }

  /// Off-diagonal block of the left Jacobian (Barfoot 2017, eq. 7.86), with the triple products reduced: for d = φ·ρ
  /// they are [φ][ρ][φ] = -d[φ] and [φ]²[ρ] + [ρ][φ]² = -|φ|²[ρ] - d[φ].
  static Matrix3 coupling(const Vector3& rho, const Vector3& phi) {
    return coupling(rho, phi, jacobianCoefficients(S(phi.dot(phi))));
  }
  static EIGEN_ALWAYS_INLINE Matrix3 coupling(const Vector3& rho, const Vector3& phi,
                                              const JacobianCoefficients<S>& c) {
    const S t = squaredNorm(phi), d = dot(phi, rho), s = c.half_sinc, b5 = S(-2) * d * c.beta5;
    const Vector3 axial = combination(S(S(0.5) * s * s), rho, S(d * (S(2) * c.beta4 - c.beta3)), phi);
    const Vector3 b = combination(c.beta3, rho, S(S(0.5) * b5), phi);
    return symmetricPlusSkew(b, phi, S(-S(2) * d * c.beta3 - b5 * t), axial);
  }
  static EIGEN_ALWAYS_INLINE Square leftJacobian(const Tangent& v) {
    const Vector3 rho = three<0>(v), phi = three<3>(v);
    const JacobianCoefficients<S> c = jacobianCoefficients(squaredNorm(phi));
    return blocks(rotationPolynomial(phi, S(1), S(S(0.5) * c.half_sinc * c.half_sinc), c.beta3), coupling(rho, phi, c));
  }
  /// Off-diagonal block of the inverse: ad(υ, ω) acts as the dual number [ω] + ε[υ], so it is the derivative of
  /// So3Math::leftJacobianInverse at φ in the direction ρ.
  static Matrix3 inverseCoupling(const Vector3& rho, const Vector3& phi) {
    return inverseCoupling(rho, phi, inverseJacobianCoefficients(squaredNorm(phi)));
  }
  static EIGEN_ALWAYS_INLINE Matrix3 inverseCoupling(const Vector3& rho, const Vector3& phi,
                                                     const InverseJacobianCoefficients<S>& c) {
    const S t = squaredNorm(phi), d = dot(phi, rho), slope = d * c.slope;
    const Vector3 b = combination(c.excess, rho, S(S(0.5) * slope), phi);
    return symmetricPlusSkew(b, phi, S(-S(2) * c.excess * d - slope * t),
                             Vector3(S(-0.5) * rho[0], S(-0.5) * rho[1], S(-0.5) * rho[2]));
  }
  static EIGEN_ALWAYS_INLINE Square leftJacobianInverse(const Tangent& v) {
    const Vector3 rho = three<0>(v), phi = three<3>(v);
    const InverseJacobianCoefficients<S> c = inverseJacobianCoefficients(squaredNorm(phi));
    return blocks(rotationPolynomial(phi, S(1), S(-0.5), c.excess), inverseCoupling(rho, phi, c));
  }
  static Eigen::Matrix<S, 7, 6> productJacobian(const Params& p) {
    Eigen::Matrix<S, 7, 6> J;
    J << Eigen::Matrix<S, 4, 3>::Zero(), Rotation::productJacobian(quaternion(p)),  //
        Rotation::matrix(quaternion(p)), Matrix3::Zero();
    return J;
  }
  static Eigen::Matrix<S, 6, 7> quotientJacobian(const Params& p) {
    Eigen::Matrix<S, 6, 7> J;
    J << Eigen::Matrix<S, 3, 4>::Zero(), Rotation::matrix(quaternion(p)).transpose(),  //
        Rotation::quotientJacobian(quaternion(p)), Matrix3::Zero();
    return J;
  }
  template <class Generator>
  static Params sampleUniform(Generator& generator) {
    const Vector4 q = Rotation::sampleUniform(generator);
    return join(q, uniformInCube<S, 3>(generator));
  }
};

}  // namespace detail

template <class Scalar_, int Options_ = 0>
class SE3;

namespace detail {

/// Accessors shared by the group SE3 and by the frames, which have the same storage.
template <class Derived, class Base>
class PoseAccess : public TranslationAccess<Derived, Base, 3, 4> {
 public:
  using Base::data;
  using typename Base::Scalar;

  /// The rotation, viewed in place.
  Eigen::Map<const SO3<Scalar>> so3() const { return Eigen::Map<const SO3<Scalar>>(data()); }
  PartView<Derived, SO3<Scalar>> so3() { return PartView<Derived, SO3<Scalar>>(data()); }
  Eigen::Map<const Eigen::Quaternion<Scalar>> unit_quaternion() const {
    return Eigen::Map<const Eigen::Quaternion<Scalar>>(data());
  }
  Eigen::Matrix<Scalar, 3, 3> rotationMatrix() const { return so3().matrix(); }
};

}  // namespace detail

/// Interface of SE3 over owned or viewed memory.
template <class Derived>
class SE3Base : public detail::PoseAccess<Derived, detail::GroupBase<Derived>> {
  using Base = detail::GroupBase<Derived>;

 public:
  using typename Base::Scalar;
  using Base::operator*;
  template <class Other>
  using SE3Product = typename Base::template GroupProduct<Other>;

  /// The first three rows of matrix().
  Eigen::Matrix<Scalar, 3, 4> matrix3x4() const { return this->matrix().template topRows<3>(); }
  Scalar angleX() const { return this->so3().angleX(); }
  Scalar angleY() const { return this->so3().angleY(); }
  Scalar angleZ() const { return this->so3().angleZ(); }
  /// Replaces the rotation, from a quaternion of any positive norm or a rotation matrix.
  void setQuaternion(const Eigen::Quaternion<Scalar>& q) { this->so3().setQuaternion(q); }
  void setRotationMatrix(const Eigen::Matrix<Scalar, 3, 3>& R) { this->so3() = SO3<Scalar>(R); }
};

using SE3d = SE3<double>;
using SE3f = SE3<float>;

}  // namespace liestat

LIESTAT_TRAITS(SE3, liestat::detail::Se3Math)

namespace liestat {

/// A rigid motion of R^3; see the header comment.
template <class Scalar_, int Options_>
class SE3 : public SE3Base<SE3<Scalar_, Options_>> {
  LIESTAT_OWNER(SE3, SE3Base);

 public:
  using Vector3 = Eigen::Matrix<Scalar_, 3, 1>;
  using Matrix3 = Eigen::Matrix<Scalar_, 3, 3>;
  using Matrix4 = Eigen::Matrix<Scalar_, 4, 4>;

  template <class D>
  SE3(const SO3Base<D>& rotation, const Vector3& translation)
      : storage_(Shell::Math::join(rotation.params(), translation)) {}
  template <class D>
  SE3(const Eigen::QuaternionBase<D>& q, const Vector3& translation) : SE3(SO3<Scalar_>(q), translation) {}
  SE3(const Matrix3& R, const Vector3& translation) : SE3(SO3<Scalar_>(R), translation) {}
  /// From a homogeneous matrix, rotation part orthogonal up to rounding.
  explicit SE3(const Matrix4& T)
      : SE3(SO3<Scalar_>(Matrix3(T.template topLeftCorner<3, 3>())), Vector3(T.template topRightCorner<3, 1>())) {}
  /// From any matrix with a translation in its last column: its rotation is the nearest.
  static SE3 fitToSE3(const Matrix4& T) {
    return SE3(SO3<Scalar_>::fitToSO3(T.template topLeftCorner<3, 3>()), Vector3(T.template topRightCorner<3, 1>()));
  }
  /// Translations along the axes, m.
  static SE3 trans(const Vector3& t) { return SE3(SO3<Scalar_>(), t); }
  static SE3 trans(const Scalar_& x, const Scalar_& y, const Scalar_& z) { return trans(Vector3(x, y, z)); }
  static SE3 transX(const Scalar_& x) { return trans(x, Scalar_(0), Scalar_(0)); }
  static SE3 transY(const Scalar_& y) { return trans(Scalar_(0), y, Scalar_(0)); }
  static SE3 transZ(const Scalar_& z) { return trans(Scalar_(0), Scalar_(0), z); }
  /// Rotations about the axes, rad.
  static SE3 rotX(const Scalar_& a) { return SE3(SO3<Scalar_>::rotX(a), Vector3::Zero()); }
  static SE3 rotY(const Scalar_& a) { return SE3(SO3<Scalar_>::rotY(a), Vector3::Zero()); }
  static SE3 rotZ(const Scalar_& a) { return SE3(SO3<Scalar_>::rotZ(a), Vector3::Zero()); }
};

template <class Scalar_, int Options_>
class Frame3;

/// SE(3) is homogeneous under itself; it is not Metric (no invariant Riemannian metric has exp as its geodesics).
template <class S, int O>
struct ManifoldTraits<SE3<S, O>> : GroupManifold<SE3<S, O>> {
  /// log det of the left Jacobian: twice the rotation's.
  static detail::VolumeElement<S, 6> logVolume(const Eigen::Matrix<S, 6, 1>& z) {
    const detail::VolumeElement<S, 3> rotation = detail::So3Math<S>::logVolume(z.template tail<3>());
    detail::VolumeElement<S, 6> v;
    v.value = S(2) * rotation.value;
    v.gradient.template tail<3>() = S(2) * rotation.gradient;
    v.hessian.template bottomRightCorner<3, 3>() = S(2) * rotation.hessian;
    return v;
  }

  using ChordalMoments = detail::QuaternionMoments<SE3<S, O>>;
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::translation, 0, 3}, {TangentPart::rotation, 3, 3}};
  /// The same data under the product metric, of lie/frame3.hpp.
  static Frame3<S, 0> metricTwin(const SE3<S, O>& x) { return Frame3<S, 0>(x); }
  static SE3<S, O> fromMetricTwin(const Frame3<S, 0>& x) { return SE3<S, O>::fromParams(x.params()); }
};

}  // namespace liestat

LIESTAT_MAPS(SE3, liestat::SE3Base)
