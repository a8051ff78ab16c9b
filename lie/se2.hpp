// SE2: rigid motions of the plane as a Lie group; the exponential is the motion on a circle.
//
// Storage        cos sin tx ty (Sophus' layout)
// Tangent        (translation m, angle rad), body frame: x·Exp(v)
// Matrix form    3×3 homogeneous matrix
// Action         on points of R^2: R p + t
// Identity       (1, 0, 0, 0)
// Metric         none that is bi-invariant: means by groupMean or MAHA, or Frame2 for Riemannian statistics
// Bad input      NaN in, NaN out
#pragma once

#include <lie/so2.hpp>

namespace liestat {
namespace detail {

/// Mathematics of SE(2) on (cos, sin, tx, ty); tangent (υ, θ).
template <class S>
struct Se2Math {
  using Scalar = S;
  using Rotation = So2Math<S>;
  static constexpr int DoF = 3, num_parameters = 4, N = 3, Dim = 2;
  using Params = Eigen::Matrix<S, 4, 1>;
  using Tangent = Eigen::Matrix<S, 3, 1>;
  using Point = Eigen::Matrix<S, 2, 1>;
  using MatrixType = Eigen::Matrix<S, 3, 3>;
  using Square = Eigen::Matrix<S, 3, 3>;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Matrix2 = Eigen::Matrix<S, 2, 2>;
  using Angle = Eigen::Matrix<S, 1, 1>;

  static Params join(const Vector2& z, const Vector2& t) { return Params(z[0], z[1], t[0], t[1]); }
  static Vector2 complex(const Params& p) { return p.template head<2>(); }
  static Vector2 translation(const Params& p) { return p.template tail<2>(); }
  /// a I + b J, J the quarter-turn.
  static Matrix2 similarity(const S& a, const S& b) {
    Matrix2 m;
    m << a, -b, b, a;
    return m;
  }

  static Params identity() { return Params(S(1), S(0), S(0), S(0)); }
  static Params product(const Params& a, const Params& b) {
    return join(Rotation::product(complex(a), complex(b)), Rotation::act(complex(a), translation(b)) + translation(a));
  }
  static Params inverse(const Params& p) {
    const Vector2 z = Rotation::inverse(complex(p));
    return join(z, -Rotation::act(z, translation(p)));
  }
  static Params normalized(const Params& p) { return join(Rotation::normalized(complex(p)), translation(p)); }
  static Point act(const Params& p, const Point& x) { return Rotation::act(complex(p), x) + translation(p); }

  static Point linear(const Params& p, const Point& x) { return Rotation::act(complex(p), x); }
  static Point rotate(const Params& p, const Point& x) { return Rotation::act(complex(p), x); }

  /// V(θ): translation of exp is V υ.
  static Matrix2 translationJacobian(const S& theta) {
    const HalfAngle<S> h = halfAngle(S(theta * theta));
    return similarity(h.sinc * h.cos, S(0.5) * theta * h.sinc * h.sinc);
  }
  static Matrix2 translationJacobianInverse(const S& theta) {
    const HalfAngle<S> h = halfAngle(S(theta * theta));
    return similarity(h.cos / h.sinc, S(-0.5) * theta);
  }
  static Params exp(const Tangent& v) {
    const Vector2 z = Rotation::exp(Angle(v[2]));
    return join(z, translationJacobian(v[2]) * v.template head<2>());
  }
  static Tangent log(const Params& p) {
    const S theta = Rotation::log(complex(p))[0];
    const Vector2 u = translationJacobianInverse(theta) * translation(p);
    return Tangent(u[0], u[1], theta);
  }
  static MatrixType matrix(const Params& p) {
    MatrixType m = MatrixType::Identity();
    m.template topLeftCorner<2, 2>() = Rotation::matrix(complex(p));
    m.template topRightCorner<2, 1>() = translation(p);
    return m;
  }
  static MatrixType hat(const Tangent& v) {
    MatrixType m = MatrixType::Zero();
    m.template topLeftCorner<2, 2>() = Rotation::hat(Angle(v[2]));
    m.template topRightCorner<2, 1>() = v.template head<2>();
    return m;
  }
  static Tangent vee(const MatrixType& m) { return Tangent(m(0, 2), m(1, 2), m(1, 0)); }
  static Square blocks(const Matrix2& translation, const Vector2& coupling, const S& rotation) {
    Square m;
    m.template topLeftCorner<2, 2>() = translation;
    m.template topRightCorner<2, 1>() = coupling;
    m(2, 0) = m(2, 1) = S(0);
    m(2, 2) = rotation;
    return m;
  }
  static Square Adj(const Params& p) { return blocks(Rotation::matrix(complex(p)), Vector2(p[3], -p[2]), S(1)); }
  static Square ad(const Tangent& v) { return blocks(similarity(S(0), v[2]), Vector2(v[1], -v[0]), S(0)); }
  /// Last column of the left Jacobian: (Σ_{k≥1} (θJ)^{k-1}/(k+1)!)·(-Jυ).
  static Vector2 coupling(const Tangent& v) {
    const S t = v[2] * v[2], s = halfAngle(t).sinc;
    return similarity(S(0.5) * s * s, v[2] * beta3(t)) * Vector2(v[1], -v[0]);
  }
  static Square leftJacobian(const Tangent& v) { return blocks(translationJacobian(v[2]), coupling(v), S(1)); }
  static Square leftJacobianInverse(const Tangent& v) {
    const Matrix2 inverse = translationJacobianInverse(v[2]);
    return blocks(inverse, -inverse * coupling(v), S(1));
  }
  static Eigen::Matrix<S, 4, 3> productJacobian(const Params& p) {
    Eigen::Matrix<S, 4, 3> J;
    J << Matrix2::Zero(), Rotation::productJacobian(complex(p)), Rotation::matrix(complex(p)), Vector2::Zero();
    return J;
  }
  static Eigen::Matrix<S, 3, 4> quotientJacobian(const Params& p) { return productJacobian(p).transpose(); }
  template <class Generator>
  static Params sampleUniform(Generator& generator) {
    const Vector2 z = Rotation::sampleUniform(generator);
    return join(z, uniformInCube<S, 2>(generator));
  }
};

/// Accessors shared by the group SE2 and by Frame2, which has the same storage.
template <class Derived, class Base>
class PlanarPoseAccess : public TranslationAccess<Derived, Base, 2, 2> {
 public:
  using Base::data;
  using typename Base::Scalar;

  /// The rotation, viewed in place.
  Eigen::Map<const SO2<Scalar>> so2() const { return Eigen::Map<const SO2<Scalar>>(data()); }
  PartView<Derived, SO2<Scalar>> so2() { return PartView<Derived, SO2<Scalar>>(data()); }
  /// The complex number (cos, sin), viewed in place.
  Eigen::Map<const Eigen::Matrix<Scalar, 2, 1>> unit_complex() const {
    return Eigen::Map<const Eigen::Matrix<Scalar, 2, 1>>(data());
  }
  Eigen::Matrix<Scalar, 2, 2> rotationMatrix() const { return so2().matrix(); }
};

}  // namespace detail

/// Interface of SE2 over owned or viewed memory.
template <class Derived>
class SE2Base : public detail::PlanarPoseAccess<Derived, detail::GroupBase<Derived>> {
  using Base = detail::GroupBase<Derived>;

 public:
  using typename Base::Scalar;
  using Base::operator*;
  template <class Other>
  using SE2Product = typename Base::template GroupProduct<Other>;

  /// The first two rows of matrix().
  Eigen::Matrix<Scalar, 2, 3> matrix2x3() const { return this->matrix().template topRows<2>(); }
  /// Replaces the rotation, from a complex number of any positive norm or a rotation matrix.
  void setComplex(const Eigen::Matrix<Scalar, 2, 1>& z) { this->so2().setComplex(z); }
  void setRotationMatrix(const Eigen::Matrix<Scalar, 2, 2>& R) { this->so2() = SO2<Scalar>(R); }
};

template <class Scalar_, int Options_ = 0>
class SE2;

using SE2d = SE2<double>;
using SE2f = SE2<float>;

}  // namespace liestat

LIESTAT_TRAITS(SE2, liestat::detail::Se2Math)

namespace liestat {

/// A rigid motion of the plane; see the header comment.
template <class Scalar_, int Options_>
class SE2 : public SE2Base<SE2<Scalar_, Options_>> {
  LIESTAT_OWNER(SE2, SE2Base);

 public:
  using Vector2 = Eigen::Matrix<Scalar_, 2, 1>;

  template <class D>
  SE2(const SO2Base<D>& rotation, const Vector2& translation)
      : storage_(Shell::Math::join(rotation.params(), translation)) {}
  /// From an angle (rad) and a translation (m).
  SE2(const Scalar_& angle, const Vector2& translation) : SE2(SO2<Scalar_>(angle), translation) {}
  /// From a homogeneous matrix, rotation part orthogonal up to rounding.
  explicit SE2(const Eigen::Matrix<Scalar_, 3, 3>& T)
      : SE2(SO2<Scalar_>(Eigen::Matrix<Scalar_, 2, 2>(T.template topLeftCorner<2, 2>())),
            Vector2(T.template topRightCorner<2, 1>())) {}
  /// From a complex number of any positive norm or a rotation matrix, and a translation (m).
  template <class D>
    requires(D::RowsAtCompileTime == 2 && (D::ColsAtCompileTime == 1 || D::ColsAtCompileTime == 2))
  SE2(const Eigen::MatrixBase<D>& rotation, const Vector2& translation) : SE2(SO2<Scalar_>(rotation), translation) {}
  /// Translations along the axes, m.
  static SE2 trans(const Vector2& t) { return SE2(SO2<Scalar_>(), t); }
  static SE2 trans(const Scalar_& x, const Scalar_& y) { return trans(Vector2(x, y)); }
  static SE2 transX(const Scalar_& x) { return trans(x, Scalar_(0)); }
  static SE2 transY(const Scalar_& y) { return trans(Scalar_(0), y); }
  /// Rotation about the origin, rad.
  static SE2 rot(const Scalar_& angle) { return SE2(angle, Vector2::Zero()); }
  /// From any matrix with a translation in its last column: its rotation is the nearest.
  static SE2 fitToSE2(const Eigen::Matrix<Scalar_, 3, 3>& T) { return SE2(T); }
};

template <class Scalar_, int Options_>
class Frame2;

/// SE(2) is homogeneous under itself, not Metric.
template <class S, int O>
struct ManifoldTraits<SE2<S, O>> : GroupManifold<SE2<S, O>> {
  /// log det of the left Jacobian, 2 log(sin(θ/2)/(θ/2)), with its gradient and Hessian.
  static detail::VolumeElement<S, 3> logVolume(const Eigen::Matrix<S, 3, 1>& z) {
    using std::log;
    const S t = z[2] * z[2], c = S(-2) * detail::cotangentExcess(t);
    detail::VolumeElement<S, 3> v;
    v.value = S(2) * log(detail::halfAngle(t).sinc);
    v.gradient[2] = c * z[2];
    v.hessian(2, 2) = c - S(2) * detail::cotangentExcessSlope(t) * t;
    return v;
  }

  using ChordalMoments = detail::ComplexMoments<SE2<S, O>>;
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::translation, 0, 2}, {TangentPart::rotation, 2, 1}};
  /// The same data under the product metric, of lie/frame2.hpp.
  static Frame2<S, 0> metricTwin(const SE2<S, O>& x) { return Frame2<S, 0>(x); }
  static SE2<S, O> fromMetricTwin(const Frame2<S, 0>& x) { return SE2<S, O>::fromParams(x.params()); }
};

}  // namespace liestat

LIESTAT_MAPS(SE2, liestat::SE2Base)
