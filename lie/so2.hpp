// SO2: rotations of the plane, as unit complex numbers.
//
// Storage        cos sin (Sophus' layout)
// Tangent        angle, rad
// Matrix form    2×2 rotation matrix; hat(θ) = [0 -θ; θ 0]
// Action         on points of R^2
// Identity       (1, 0)
// Metric         distance = angle, bi-invariant, flat, injectivity radius pi
// Bad input      NaN in, NaN out
#pragma once

#include <lie/detail/chordal.hpp>
#include <lie/detail/group_base.hpp>
#include <lie/manifold.hpp>

namespace liestat {
namespace detail {

/// Mathematics of SO(2) on (cos, sin).
template <class S>
struct So2Math {
  using Scalar = S;
  static constexpr int DoF = 1, num_parameters = 2, N = 2, Dim = 2;
  using Params = Eigen::Matrix<S, 2, 1>;
  using Tangent = Eigen::Matrix<S, 1, 1>;
  using Point = Eigen::Matrix<S, 2, 1>;
  using MatrixType = Eigen::Matrix<S, 2, 2>;
  using Square = Eigen::Matrix<S, 1, 1>;

  static Params identity() { return Params(S(1), S(0)); }
  static Params product(const Params& a, const Params& b) {
    Params z(a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]);
    if constexpr (is_single_precision<S>) {
      return z * (S(0.5) * (S(3) - z.dot(z)));
    } else {
      return z;
    }
  }
  static Params inverse(const Params& z) { return Params(z[0], -z[1]); }
  static Params normalized(const Params& z) {
    using std::sqrt;
    return z / sqrt(z.dot(z));
  }
  static Point act(const Params& z, const Point& p) {
    return Point(z[0] * p[0] - z[1] * p[1], z[1] * p[0] + z[0] * p[1]);
  }
  static Point linear(const Params& z, const Point& p) { return act(z, p); }
  static Point rotate(const Params& z, const Point& p) { return act(z, p); }
  static MatrixType matrix(const Params& z) {
    MatrixType m;
    m << z[0], -z[1], z[1], z[0];
    return m;
  }
  static Params exp(const Tangent& v) {
    using std::cos, std::sin;
    return Params(cos(v[0]), sin(v[0]));
  }
  static Tangent log(const Params& z) {
    using std::atan2;
    return Tangent(atan2(z[1], z[0]));
  }
  static MatrixType hat(const Tangent& v) {
    MatrixType m;
    m << S(0), -v[0], v[0], S(0);
    return m;
  }
  static Tangent vee(const MatrixType& m) { return Tangent(m(1, 0)); }
  static Square Adj(const Params&) { return Square::Identity(); }
  static Square ad(const Tangent&) { return Square::Zero(); }
  static Square leftJacobian(const Tangent&) { return Square::Identity(); }
  static Square leftJacobianInverse(const Tangent&) { return Square::Identity(); }
  /// ∂(z·exp(d))/∂d and ∂log(z⁻¹x)/∂x at x = z, on parameters.
  static Params productJacobian(const Params& z) { return Params(-z[1], z[0]); }
  static Eigen::Matrix<S, 1, 2> quotientJacobian(const Params& z) { return productJacobian(z).transpose(); }
  template <class Generator>
  static Params sampleUniform(Generator& generator) {
    return uniformOnCircle<S>(generator);
  }
};

}  // namespace detail

/// Interface of SO2 over owned or viewed memory.
template <class Derived>
class SO2Base : public detail::GroupBase<Derived> {
  using Base = detail::GroupBase<Derived>;

 public:
  using Base::exp, Base::hat;
  using typename Base::Math, typename Base::Plain, typename Base::Scalar, typename Base::Tangent;
  using typename Base::Transformation;
  using Base::operator*;
  template <class Other>
  using SO2Product = typename Base::template GroupProduct<Other>;
  /// The complex number (cos, sin), viewed in place.
  Eigen::Map<const Eigen::Matrix<Scalar, 2, 1>> unit_complex() const {
    return Eigen::Map<const Eigen::Matrix<Scalar, 2, 1>>(this->data());
  }
  /// Rotation by an angle, rad.
  template <class Angle>
    requires(std::is_same_v<Angle, Scalar> || std::is_arithmetic_v<Angle>)
  static Plain exp(const Angle& angle) { return Base::exp(Tangent(Scalar(angle))); }
  template <class Angle>
    requires(std::is_same_v<Angle, Scalar> || std::is_arithmetic_v<Angle>)
  static Transformation hat(const Angle& angle) { return Base::hat(Tangent(Scalar(angle))); }
  /// Replaces the rotation by that of a complex number of any positive norm.
  void setComplex(const Eigen::Matrix<Scalar, 2, 1>& z) { this->derived().mutableStorage() = Math::normalized(z); }
  /// The angle in (-pi, pi], rad.
  Scalar angle() const { return this->log()[0]; }
  Eigen::Matrix<Scalar, 2, 2> rotationMatrix() const { return this->matrix(); }
};

template <class Scalar_, int Options_ = 0>
class SO2;

using SO2d = SO2<double>;
using SO2f = SO2<float>;

}  // namespace liestat

LIESTAT_TRAITS(SO2, liestat::detail::So2Math)

namespace liestat {

/// A rotation of the plane; see the header comment.
template <class Scalar_, int Options_>
class SO2 : public SO2Base<SO2<Scalar_, Options_>> {
  LIESTAT_OWNER(SO2, SO2Base);

 public:
  /// From an angle, rad.
  explicit SO2(const Scalar_& angle) : SO2(Shell::exp(angle)) {}
  /// From a complex number of any positive norm, which is normalised.
  SO2(const Scalar_& real, const Scalar_& imag)
      : storage_(Shell::Math::normalized(typename Shell::Params(real, imag))) {}
  /// From a complex number as a vector (cos, sin) of any positive norm, or from a rotation matrix, orthogonal up to
  /// rounding.
  template <class D>
    requires(D::RowsAtCompileTime == 2 && (D::ColsAtCompileTime == 1 || D::ColsAtCompileTime == 2))
  explicit SO2(const Eigen::MatrixBase<D>& m) : storage_(fromMatrix(m)) {}
  /// The rotation nearest to any matrix, in the Frobenius norm; NaN for multiples of a reflection, which have none.
  static SO2 fitToSO2(const Eigen::Matrix<Scalar_, 2, 2>& M) { return SO2(M); }

 private:
  template <class D>
  static typename Shell::Params fromMatrix(const Eigen::MatrixBase<D>& m) {
    using Params = typename Shell::Params;
    if constexpr (D::ColsAtCompileTime == 1) {
      return Shell::Math::normalized(Params(m));
    } else {
      return Shell::Math::normalized(Params(m(0, 0) + m(1, 1), m(1, 0) - m(0, 1)));
    }
  }
};

/// SO(2) under its bi-invariant, flat metric.
template <class S, int O>
struct ManifoldTraits<SO2<S, O>> : GroupManifold<SO2<S, O>> {
  using Tangent = Eigen::Matrix<S, 1, 1>;
  using Square = Eigen::Matrix<S, 1, 1>;

  static Tangent metricWeights() { return Tangent::Ones(); }
  static S injectivityRadius() { return S(EIGEN_PI); }
  static S maxSectionalCurvature() { return S(0); }
  static Square hessianHalfSquaredDistance(const Tangent&) { return Square::Identity(); }
  static Square dlogFeatureTransposed(const Tangent&, const Tangent&) { return Square::Zero(); }
  static Square dlogBaseTransposed(const Tangent&, const Tangent&) { return Square::Zero(); }
  static detail::VolumeElement<S, 1> logVolume(const Tangent&) { return {}; }

  using ChordalMoments = detail::ComplexMoments<SO2<S, O>>;
  static constexpr CompactFactor compact_factor = CompactFactor::circle;
  static constexpr int compact_begin = 0;
  static Eigen::Matrix<S, 2, 1> compactCoordinates(const SO2<S, O>& x) { return x.params(); }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::rotation, 0, 1}};
};

}  // namespace liestat

LIESTAT_MAPS(SO2, liestat::SO2Base)
