// RxSO2: rotations with a scale in the plane, s R, as complex numbers other than zero.
//
// Storage        s cos, s sin (Sophus' layout)
// Tangent        (angle rad, logarithm of the scale)
// Matrix form    2×2 matrix s R; hat(θ, σ) = [σ -θ; θ σ]
// Action         on points of R^2: s R p
// Identity       (1, 0)
// Scale          saturates at 1e-10 and 1e10 (float: 1e-5 and 1e5), as in Sophus
// Metric         the flat product: distance² = angle² + (difference of the logarithms)²
// Bad input      NaN in, NaN out
#pragma once

#include <lie/detail/scale.hpp>
#include <lie/so2.hpp>

namespace liestat {
namespace detail {

/// Mathematics of R⁺ × SO(2) on complex numbers (re, im).
template <class S>
struct RxSo2Math {
  using Scalar = S;
  using Rotation = So2Math<S>;
  static constexpr int DoF = 2, num_parameters = 2, N = 2, Dim = 2;
  using Params = Eigen::Matrix<S, 2, 1>;
  using Tangent = Eigen::Matrix<S, 2, 1>;
  using Point = Eigen::Matrix<S, 2, 1>;
  using MatrixType = Eigen::Matrix<S, 2, 2>;
  using Square = Eigen::Matrix<S, 2, 2>;

  static Params identity() { return Params(S(1), S(0)); }
  /// Product of complex numbers, its scale kept in the admitted range.
  static Params product(const Params& a, const Params& b) {
    const Params z(a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]);
    return saturated(z, z.dot(z), ScaleRange<S>::least * ScaleRange<S>::least);
  }
  static Params inverse(const Params& z) { return Params(z[0], -z[1]) / z.dot(z); }
  /// All numbers but zero are elements.
  static Params normalized(const Params& z) { return z; }
  static S scale(const Params& z) {
    using std::sqrt;
    return sqrt(z.dot(z));
  }
  static Params rotation(const Params& z) { return Rotation::normalized(z); }
  static Point act(const Params& z, const Point& p) { return matrix(z) * p; }
  static Point linear(const Params& z, const Point& p) { return act(z, p); }
  static Point rotate(const Params& z, const Point& p) { return Rotation::act(rotation(z), p); }
  static MatrixType matrix(const Params& z) {
    MatrixType m;
    m << z[0], -z[1], z[1], z[0];
    return m;
  }
  static Params exp(const Tangent& v) {
    using std::cos, std::exp, std::sin;
    const S s = exp(saturatedLogarithm(v[1]));
    return Params(s * cos(v[0]), s * sin(v[0]));
  }
  static Tangent log(const Params& z) {
    using std::atan2, std::log;
    return Tangent(atan2(z[1], z[0]), S(0.5) * log(z.dot(z)));
  }
  static MatrixType hat(const Tangent& v) { return matrix(Params(v[1], v[0])); }
  static Tangent vee(const MatrixType& m) { return Tangent(m(1, 0), m(0, 0)); }
  static Square Adj(const Params&) { return Square::Identity(); }
  static Square ad(const Tangent&) { return Square::Zero(); }
  static Square leftJacobian(const Tangent&) { return Square::Identity(); }
  static Square leftJacobianInverse(const Tangent&) { return Square::Identity(); }
  static Square productJacobian(const Params& z) {
    Square J;
    J << -z[1], z[0], z[0], z[1];
    return J;
  }
  static Square quotientJacobian(const Params& z) { return productJacobian(z) / z.dot(z); }
  template <class Generator>
  static Params sampleUniform(Generator& generator) {
    const S s = uniformScale<S>(generator);
    return s * Rotation::sampleUniform(generator);
  }
};

}  // namespace detail

/// Interface of RxSO2 over owned or viewed memory.
template <class Derived>
class RxSO2Base : public detail::GroupBase<Derived> {
  using Base = detail::GroupBase<Derived>;

 public:
  using typename Base::Math, typename Base::Plain, typename Base::Scalar;
  using Base::operator*;
  template <class Other>
  using RxSO2Product = typename Base::template GroupProduct<Other>;
  using Matrix2 = Eigen::Matrix<Scalar, 2, 2>;
  using Vector2 = Eigen::Matrix<Scalar, 2, 1>;

  /// The complex number, viewed in place; its norm is the scale.
  Eigen::Map<const Vector2> complex() const { return Eigen::Map<const Vector2>(this->data()); }
  Scalar scale() const { return Math::scale(this->params()); }
  /// The angle in (-pi, pi], rad.
  Scalar angle() const { return this->log()[0]; }
  SO2<Scalar> so2() const { return SO2<Scalar>::fromParams(Math::rotation(this->params())); }
  /// The rotation without its scale; matrix() has both.
  Matrix2 rotationMatrix() const { return so2().matrix(); }

  /// Replaces scale and rotation.
  void setComplex(const Vector2& z) { this->derived().mutableStorage() = z; }
  void setScaledRotationMatrix(const Matrix2& sR) {
    setComplex(Scalar(0.5) * Vector2(sR(0, 0) + sR(1, 1), sR(1, 0) - sR(0, 1)));
  }
  /// Replaces the scale, s > 0, and leaves the rotation.
  void setScale(const Scalar& s) { setComplex(s * Math::rotation(this->params())); }
  /// Replaces the rotation and leaves the scale.
  void setSO2(const SO2<Scalar>& rotation) { setComplex(scale() * rotation.params()); }
  void setAngle(const Scalar& angle) { setSO2(SO2<Scalar>(angle)); }
  void setRotationMatrix(const Matrix2& R) { setSO2(SO2<Scalar>(R)); }
};

template <class Scalar_, int Options_ = 0>
class RxSO2;

using RxSO2d = RxSO2<double>;
using RxSO2f = RxSO2<float>;

}  // namespace liestat

LIESTAT_TRAITS(RxSO2, liestat::detail::RxSo2Math)

namespace liestat {

/// A rotation of the plane with a scale; see the header comment.
template <class Scalar_, int Options_>
class RxSO2 : public RxSO2Base<RxSO2<Scalar_, Options_>> {
  LIESTAT_OWNER(RxSO2, RxSO2Base);

 public:
  using Matrix2 = Eigen::Matrix<Scalar_, 2, 2>;

  /// From a complex number other than zero.
  RxSO2(const Scalar_& real, const Scalar_& imag) : storage_(real, imag) {}
  /// From a complex number other than zero as a vector, or from a scaled rotation matrix.
  template <class D>
    requires(D::RowsAtCompileTime == 2 && (D::ColsAtCompileTime == 1 || D::ColsAtCompileTime == 2))
  explicit RxSO2(const Eigen::MatrixBase<D>& m) {
    if constexpr (D::ColsAtCompileTime == 1) {
      this->setComplex(m);
    } else {
      this->setScaledRotationMatrix(m);
    }
  }
  /// From a scale s > 0 and a rotation.
  template <class D>
  RxSO2(const Scalar_& scale, const SO2Base<D>& rotation) : storage_(scale * rotation.params()) {}
  RxSO2(const Scalar_& scale, const Matrix2& R) : RxSO2(scale, SO2<Scalar_>(R)) {}
};

/// R⁺ × SO(2) under its bi-invariant, flat metric.
template <class S, int O>
struct ManifoldTraits<RxSO2<S, O>> : GroupManifold<RxSO2<S, O>> {
  using Tangent = Eigen::Matrix<S, 2, 1>;
  using Square = Eigen::Matrix<S, 2, 2>;

  static Tangent metricWeights() { return Tangent::Ones(); }
  static S injectivityRadius() { return S(EIGEN_PI); }
  static S maxSectionalCurvature() { return S(0); }
  static Square hessianHalfSquaredDistance(const Tangent&) { return Square::Identity(); }
  static Square dlogFeatureTransposed(const Tangent&, const Tangent&) { return Square::Zero(); }
  static Square dlogBaseTransposed(const Tangent&, const Tangent&) { return Square::Zero(); }
  static detail::VolumeElement<S, 2> logVolume(const Tangent&) { return {}; }

  static constexpr CompactFactor compact_factor = CompactFactor::circle;
  static constexpr int compact_begin = 0;
  static Eigen::Matrix<S, 2, 1> compactCoordinates(const RxSO2<S, O>& x) { return x.params().normalized(); }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::rotation, 0, 1}, {TangentPart::log_scale, 1, 1}};
};

}  // namespace liestat

LIESTAT_MAPS(RxSO2, liestat::RxSO2Base)
