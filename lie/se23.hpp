// SE23: extended poses of R^3, the Lie group SE_2(3) of rotation, position and velocity: the state of an inertial
// sensor, and the increment of preintegrated measurements (Barrau and Bonnabel 2017; Brossard et al. 2022).
//
// Storage        qx qy qz qw px py pz vx vy vz; the first seven numbers are an SE3
// Tangent        (position m, rotation rad, velocity m/s), body frame: x·Exp(v)
// Matrix form    5×5 matrix [R p v; 0 1 0; 0 0 1]; hat(ρ, φ, ν) = [[φ] ρ ν; 0 0 0; 0 0 0]
// Action         on points of R^3: R x + p; the velocity takes no part
// Identity       (0, 0, 0, 1, 0, 0, 0, 0, 0, 0)
// Metric         none that is bi-invariant: means by groupMean or MAHA
// Bad input      NaN in, NaN out; quaternions are normalised on construction
#pragma once

#include <lie/se3.hpp>

namespace liestat {
namespace detail {

/// Mathematics of SE_2(3) on (quaternion, position, velocity); tangent (ρ, φ, ν). Position and velocity each
/// transform as the translation of SE(3) does, independently of each other.
template <class S>
struct Se23Math {
  using Scalar = S;
  using Pose = Se3Math<S>;
  using Rotation = So3Math<S>;
  static constexpr int DoF = 9, num_parameters = 10, N = 5, Dim = 3;
  using Params = Eigen::Matrix<S, 10, 1>;
  using Tangent = Eigen::Matrix<S, 9, 1>;
  using Point = Eigen::Matrix<S, 3, 1>;
  using MatrixType = Eigen::Matrix<S, 5, 5>;
  using Square = Eigen::Matrix<S, 9, 9>;
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Vector4 = Eigen::Matrix<S, 4, 1>;
  using Matrix3 = Eigen::Matrix<S, 3, 3>;

  static Params join(const Vector4& q, const Vector3& p, const Vector3& v) {
    Params x;
    x << q, p, v;
    return x;
  }
  static Vector4 quaternion(const Params& x) { return x.template head<4>(); }
  static Vector3 translation(const Params& x) { return x.template segment<3>(4); }
  static Vector3 velocity(const Params& x) { return x.template tail<3>(); }

  static Params identity() { return join(Rotation::identity(), Vector3::Zero(), Vector3::Zero()); }
  static Params product(const Params& a, const Params& b) {
    const Vector4 q = quaternion(a);
    return join(Rotation::product(q, quaternion(b)), Rotation::act(q, translation(b)) + translation(a),
                Rotation::act(q, velocity(b)) + velocity(a));
  }
  static Params inverse(const Params& x) {
    const Vector4 q = Rotation::inverse(quaternion(x));
    return join(q, -Rotation::act(q, translation(x)), -Rotation::act(q, velocity(x)));
  }
  static Params normalized(const Params& x) {
    return join(Rotation::normalized(quaternion(x)), translation(x), velocity(x));
  }
  static Point act(const Params& x, const Point& p) { return Rotation::act(quaternion(x), p) + translation(x); }
  static Point linear(const Params& x, const Point& p) { return Rotation::act(quaternion(x), p); }
  static Point rotate(const Params& x, const Point& p) { return Rotation::act(quaternion(x), p); }

  static Params exp(const Tangent& t) {
    const Vector3 phi = t.template segment<3>(3);
    const Matrix3 J = Rotation::leftJacobian(phi);
    return join(Rotation::exp(phi), J * t.template head<3>(), J * t.template tail<3>());
  }
  static Tangent log(const Params& x) {
    const Vector3 phi = Rotation::log(quaternion(x));
    const Matrix3 J = Rotation::leftJacobianInverse(phi);
    Tangent t;
    t << J * translation(x), phi, J * velocity(x);
    return t;
  }

  static MatrixType matrix(const Params& x) {
    MatrixType m = MatrixType::Identity();
    m.template topRows<3>() << Rotation::matrix(quaternion(x)), translation(x), velocity(x);
    return m;
  }
  static MatrixType hat(const Tangent& t) {
    MatrixType m = MatrixType::Zero();
    m.template topRows<3>() << skew(t.template segment<3>(3)), t.template head<3>(), t.template tail<3>();
    return m;
  }
  static Tangent vee(const MatrixType& m) {
    Tangent t;
    t << m.template block<3, 1>(0, 3), Rotation::vee(m.template topLeftCorner<3, 3>()), m.template block<3, 1>(0, 4);
    return t;
  }
  /// The block form [D P 0; 0 D 0; 0 V D] of Adj, ad and the Jacobians.
  static Square blocks(const Matrix3& D, const Matrix3& P, const Matrix3& V) {
    const Matrix3 zero = Matrix3::Zero();
    Square m;
    m << D, P, zero, zero, D, zero, zero, V, D;
    return m;
  }
  static Square Adj(const Params& x) {
    const Matrix3 R = Rotation::matrix(quaternion(x));
    return blocks(R, skew(translation(x)) * R, skew(velocity(x)) * R);
  }
  static Square ad(const Tangent& t) {
    return blocks(skew(t.template segment<3>(3)), skew(t.template head<3>()), skew(t.template tail<3>()));
  }
  static Square leftJacobian(const Tangent& t) {
    const Vector3 rho = t.template head<3>(), phi = t.template segment<3>(3), nu = t.template tail<3>();
    return blocks(Rotation::leftJacobian(phi), Pose::coupling(rho, phi), Pose::coupling(nu, phi));
  }
  static Square leftJacobianInverse(const Tangent& t) {
    const Vector3 rho = t.template head<3>(), phi = t.template segment<3>(3), nu = t.template tail<3>();
    return blocks(Rotation::leftJacobianInverse(phi), Pose::inverseCoupling(rho, phi), Pose::inverseCoupling(nu, phi));
  }
  /// ∂(x·exp(d))/∂d at d = 0 (productJacobian) and ∂log(x⁻¹y)/∂y at y = x (quotientJacobian), by the parameters.
  static Eigen::Matrix<S, 10, 9> productJacobian(const Params& x) {
    Eigen::Matrix<S, 10, 9> J = Eigen::Matrix<S, 10, 9>::Zero();
    J.template block<4, 3>(0, 3) = Rotation::productJacobian(quaternion(x));
    J.template block<3, 3>(4, 0) = J.template block<3, 3>(7, 6) = Rotation::matrix(quaternion(x));
    return J;
  }
  static Eigen::Matrix<S, 9, 10> quotientJacobian(const Params& x) {
    Eigen::Matrix<S, 9, 10> J = Eigen::Matrix<S, 9, 10>::Zero();
    J.template block<3, 4>(3, 0) = Rotation::quotientJacobian(quaternion(x));
    J.template block<3, 3>(0, 4) = J.template block<3, 3>(6, 7) = Rotation::matrix(quaternion(x)).transpose();
    return J;
  }
  /// Rotation uniform, position and velocity uniform in [-1, 1]^3.
  template <class Generator>
  static Params sampleUniform(Generator& generator) {
    const typename Pose::Params pose = Pose::sampleUniform(generator);
    return join(Pose::quaternion(pose), Pose::translation(pose), Pose::translation(Pose::sampleUniform(generator)));
  }
};

}  // namespace detail

template <class Scalar_, int Options_ = 0>
class SE23;

/// Interface of SE23 over owned or viewed memory: so3() and translation() as in SE3, pose() and velocity().
template <class Derived>
class SE23Base : public detail::PoseAccess<Derived, detail::GroupBase<Derived>> {
  using Base = detail::GroupBase<Derived>;

 public:
  using Base::data;
  using typename Base::Scalar;
  using Base::operator*;
  using Vector3 = Eigen::Matrix<Scalar, 3, 1>;

  /// The pose, rotation and position, viewed in place.
  Eigen::Map<const SE3<Scalar>> pose() const { return Eigen::Map<const SE3<Scalar>>(data()); }
  detail::PartView<Derived, SE3<Scalar>> pose() { return detail::PartView<Derived, SE3<Scalar>>(data()); }
  /// The velocity (m/s) in the axes of the position, viewed in place.
  Eigen::Map<const Vector3> velocity() const { return Eigen::Map<const Vector3>(data() + 7); }
  detail::PartView<Derived, Vector3> velocity() { return detail::PartView<Derived, Vector3>(data() + 7); }
};

using SE23d = SE23<double>;
using SE23f = SE23<float>;

}  // namespace liestat

LIESTAT_TRAITS(SE23, liestat::detail::Se23Math)

namespace liestat {

/// An extended pose; see the header comment.
template <class Scalar_, int Options_>
class SE23 : public SE23Base<SE23<Scalar_, Options_>> {
  LIESTAT_OWNER(SE23, SE23Base);

 public:
  using Vector3 = Eigen::Matrix<Scalar_, 3, 1>;
  using Matrix3 = Eigen::Matrix<Scalar_, 3, 3>;
  using Matrix5 = Eigen::Matrix<Scalar_, 5, 5>;

  /// From rotation, position (m) and velocity (m/s).
  template <class D>
  SE23(const SO3Base<D>& rotation, const Vector3& position, const Vector3& velocity)
      : storage_(Shell::Math::join(rotation.params(), position, velocity)) {}
  template <class D>
  SE23(const Eigen::QuaternionBase<D>& q, const Vector3& position, const Vector3& velocity)
      : SE23(SO3<Scalar_>(q), position, velocity) {}
  SE23(const Matrix3& R, const Vector3& position, const Vector3& velocity)
      : SE23(SO3<Scalar_>(R), position, velocity) {}
  template <class D>
  SE23(const SE3Base<D>& pose, const Vector3& velocity) : SE23(pose.so3(), Vector3(pose.translation()), velocity) {}
  /// From a 5×5 matrix as matrix() returns it, with a rotation part that is orthogonal up to rounding.
  explicit SE23(const Matrix5& T)
      : SE23(Matrix3(T.template topLeftCorner<3, 3>()), Vector3(T.template block<3, 1>(0, 3)),
             Vector3(T.template block<3, 1>(0, 4))) {}
};

/// SE_2(3) acts on itself: Homogeneous, but not Metric, because no metric on it is bi-invariant.
template <class S, int O>
struct ManifoldTraits<SE23<S, O>> : GroupManifold<SE23<S, O>> {
  /// log det of the left Jacobian, which has three diagonal blocks equal to that of the rotation: three times its value.
  static detail::VolumeElement<S, 9> logVolume(const Eigen::Matrix<S, 9, 1>& z) {
    const detail::VolumeElement<S, 3> rotation = detail::So3Math<S>::logVolume(z.template segment<3>(3));
    detail::VolumeElement<S, 9> v;
    v.value = S(3) * rotation.value;
    v.gradient.template segment<3>(3) = S(3) * rotation.gradient;
    v.hessian.template block<3, 3>(3, 3) = S(3) * rotation.hessian;
    return v;
  }

  using ChordalMoments = detail::QuaternionMoments<SE23<S, O>>;
  static constexpr TangentBlock tangent_parts[] = {
      {TangentPart::translation, 0, 3}, {TangentPart::rotation, 3, 3}, {TangentPart::velocity, 6, 3}};
};

}  // namespace liestat

LIESTAT_MAPS(SE23, liestat::SE23Base)
