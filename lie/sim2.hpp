// Sim2: similarities of the plane, s R p + t.
//
// Storage        s cos, s sin, tx, ty (Sophus' layout)
// Tangent        (translation m, angle rad, logarithm of the scale), body frame: x·Exp(v)
// Matrix form    3×3 homogeneous matrix; hat(υ, θ, σ) = [σ -θ υ; θ σ υ; 0 0 0]
// Action         on points of R^2: s R p + t
// Identity       (1, 0, 0, 0)
// Scale          saturates at 1e-10 and 1e10 (float: 1e-5 and 1e5), as in Sophus
// Metric         none that is bi-invariant: means by groupMean or MAHA
// Bad input      NaN in, NaN out
#pragma once

#include <lie/detail/similarity_series.hpp>
#include <lie/rxso2.hpp>

namespace liestat {
namespace detail {

/// Mathematics of Sim(2) on (complex number, translation); tangent (υ, θ, σ).
template <class S>
struct Sim2Math {
  using Scalar = S;
  using Linear = RxSo2Math<S>;
  static constexpr int DoF = 4, num_parameters = 4, N = 3, Dim = 2;
  using Params = Eigen::Matrix<S, 4, 1>;
  using Tangent = Eigen::Matrix<S, 4, 1>;
  using Point = Eigen::Matrix<S, 2, 1>;
  using MatrixType = Eigen::Matrix<S, 3, 3>;
  using Square = Eigen::Matrix<S, 4, 4>;
  using Vector2 = Eigen::Matrix<S, 2, 1>;
  using Matrix2 = Eigen::Matrix<S, 2, 2>;

  static Params join(const Vector2& z, const Vector2& t) { return Params(z[0], z[1], t[0], t[1]); }
  static Vector2 complex(const Params& p) { return p.template head<2>(); }
  static Vector2 translation(const Params& p) { return p.template tail<2>(); }

  static Params identity() { return Params(S(1), S(0), S(0), S(0)); }
  static Params product(const Params& a, const Params& b) {
    return join(Linear::product(complex(a), complex(b)), act(a, translation(b)));
  }
  static Params inverse(const Params& p) {
    const Vector2 z = Linear::inverse(complex(p));
    return join(z, -Linear::act(z, translation(p)));
  }
  static Params normalized(const Params& p) { return p; }
  static S scale(const Params& p) { return Linear::scale(complex(p)); }
  static Point act(const Params& p, const Point& x) { return Linear::act(complex(p), x) + translation(p); }
  static Point linear(const Params& p, const Point& x) { return Linear::act(complex(p), x); }
  static Point rotate(const Params& p, const Point& x) { return Linear::rotate(complex(p), x); }

  /// a I + b θ J, J the quarter-turn.
  static Matrix2 matrixOf(const Planar<S>& e, const S& theta) {
    Matrix2 m;
    m << e.a, -e.b * theta, e.b * theta, e.a;
    return m;
  }
  static Params exp(const Tangent& v) {
    const S sigma = saturatedLogarithm(v[3]);
    const Matrix2 W = matrixOf(similarityIntegrals<Planar<S>>(sigma, S(v[2] * v[2])).phi, v[2]);
    return join(Linear::exp(v.template tail<2>()), W * v.template head<2>());
  }
  static Tangent log(const Params& p) {
    const Vector2 l = Linear::log(complex(p));
    const S t = l[0] * l[0];
    const Vector2 u =
        matrixOf(Planar<S>::inverse(similarityIntegrals<Planar<S>>(l[1], t).phi, t), l[0]) * translation(p);
    return Tangent(u[0], u[1], l[0], l[1]);
  }
  static MatrixType matrix(const Params& p) {
    MatrixType m = MatrixType::Identity();
    m.template topLeftCorner<2, 2>() = Linear::matrix(complex(p));
    m.template topRightCorner<2, 1>() = translation(p);
    return m;
  }
  static MatrixType hat(const Tangent& v) {
    MatrixType m = MatrixType::Zero();
    m.template topLeftCorner<2, 2>() = Linear::hat(v.template tail<2>());
    m.template topRightCorner<2, 1>() = v.template head<2>();
    return m;
  }
  static Tangent vee(const MatrixType& m) { return Tangent(m(0, 2), m(1, 2), m(1, 0), m(0, 0)); }
  /// (A, B; 0, diagonal·I)
  static Square blocks(const Matrix2& A, const Matrix2& B, const S& diagonal) {
    Square m;
    m << A, B, Matrix2::Zero(), diagonal * Matrix2::Identity();
    return m;
  }
  /// The columns of θ and σ of ad(υ, ·): -J υ and -υ.
  static Matrix2 coupling(const Vector2& u) {
    Matrix2 m;
    m << u[1], -u[0], -u[0], -u[1];
    return m;
  }
  static Square Adj(const Params& p) { return blocks(Linear::matrix(complex(p)), coupling(translation(p)), S(1)); }
  static Square ad(const Tangent& v) {
    return blocks(Linear::hat(v.template tail<2>()), coupling(v.template head<2>()), S(0));
  }
  static Square leftJacobian(const Tangent& v) {
    const auto w = similarityIntegrals<Planar<S>>(v[3], S(v[2] * v[2]));
    return blocks(matrixOf(w.phi, v[2]), matrixOf(w.psi, v[2]) * coupling(v.template head<2>()), S(1));
  }
  static Square leftJacobianInverse(const Tangent& v) {
    const S t = v[2] * v[2];
    const auto w = similarityIntegrals<Planar<S>>(v[3], t);
    const Matrix2 inverse = matrixOf(Planar<S>::inverse(w.phi, t), v[2]);
    return blocks(inverse, -inverse * matrixOf(w.psi, v[2]) * coupling(v.template head<2>()), S(1));
  }
  static Square productJacobian(const Params& p) {
    Square J;
    J << Matrix2::Zero(), Linear::productJacobian(complex(p)), Linear::matrix(complex(p)), Matrix2::Zero();
    return J;
  }
  static Square quotientJacobian(const Params& p) {
    Square J;
    J << Matrix2::Zero(), Linear::matrix(Linear::inverse(complex(p))), Linear::quotientJacobian(complex(p)),
        Matrix2::Zero();
    return J;
  }
  template <class Generator>
  static Params sampleUniform(Generator& generator) {
    const Vector2 z = Linear::sampleUniform(generator);
    return join(z, uniformInCube<S, 2>(generator));
  }
};

}  // namespace detail

/// Interface of Sim2 over owned or viewed memory.
template <class Derived>
class Sim2Base : public detail::TranslationAccess<Derived, detail::GroupBase<Derived>, 2, 2> {
  using Base = detail::GroupBase<Derived>;

 public:
  using Base::data;
  using typename Base::Math, typename Base::Scalar;
  using Base::operator*;
  template <class Other>
  using Sim2Product = typename Base::template GroupProduct<Other>;
  using Matrix2 = Eigen::Matrix<Scalar, 2, 2>;
  using Vector2 = Eigen::Matrix<Scalar, 2, 1>;

  /// Scale and rotation, viewed in place.
  Eigen::Map<const RxSO2<Scalar>> rxso2() const { return Eigen::Map<const RxSO2<Scalar>>(data()); }
  detail::PartView<Derived, RxSO2<Scalar>> rxso2() { return detail::PartView<Derived, RxSO2<Scalar>>(data()); }
  /// The complex number, viewed in place; its norm is the scale.
  Eigen::Map<const Vector2> complex() const { return Eigen::Map<const Vector2>(data()); }
  Scalar scale() const { return Math::scale(this->params()); }
  SO2<Scalar> so2() const { return rxso2().so2(); }
  /// The rotation without its scale.
  Matrix2 rotationMatrix() const { return rxso2().rotationMatrix(); }
  /// The first two rows of matrix().
  Eigen::Matrix<Scalar, 2, 3> matrix2x3() const { return this->matrix().template topRows<2>(); }

  /// Replaces scale and rotation.
  void setComplex(const Vector2& z) { rxso2().setComplex(z); }
  void setScaledRotationMatrix(const Matrix2& sR) { rxso2().setScaledRotationMatrix(sR); }
  /// Replaces the scale, s > 0, or the rotation, and leaves the other.
  void setScale(const Scalar& s) { rxso2().setScale(s); }
  void setRotationMatrix(const Matrix2& R) { rxso2().setRotationMatrix(R); }
};

template <class Scalar_, int Options_ = 0>
class Sim2;

using Sim2d = Sim2<double>;
using Sim2f = Sim2<float>;

}  // namespace liestat

LIESTAT_TRAITS(Sim2, liestat::detail::Sim2Math)

namespace liestat {

/// A similarity of the plane; see the header comment.
template <class Scalar_, int Options_>
class Sim2 : public Sim2Base<Sim2<Scalar_, Options_>> {
  LIESTAT_OWNER(Sim2, Sim2Base);

 public:
  using Vector2 = Eigen::Matrix<Scalar_, 2, 1>;

  template <class D>
  Sim2(const RxSO2Base<D>& rxso2, const Vector2& translation)
      : storage_(Shell::Math::join(rxso2.params(), translation)) {}
  /// From a complex number other than zero, whose norm is the scale, and a translation (m).
  Sim2(const Vector2& complex, const Vector2& translation) : storage_(Shell::Math::join(complex, translation)) {}
  /// From a homogeneous matrix with a scaled rotation.
  explicit Sim2(const Eigen::Matrix<Scalar_, 3, 3>& T)
      : Sim2(RxSO2<Scalar_>(T.template topLeftCorner<2, 2>()), Vector2(T.template topRightCorner<2, 1>())) {}
};

/// Sim(2) is homogeneous under itself, not Metric.
template <class S, int O>
struct ManifoldTraits<Sim2<S, O>> : GroupManifold<Sim2<S, O>> {
  static constexpr TangentBlock tangent_parts[] = {
      {TangentPart::translation, 0, 2}, {TangentPart::rotation, 2, 1}, {TangentPart::log_scale, 3, 1}};
};

}  // namespace liestat

LIESTAT_MAPS(Sim2, liestat::Sim2Base)
