// SO3: rotations of R^3, as unit quaternions.
//
// Storage        x y z w (Eigen's and Sophus' layout); q and -q are the same rotation
// Tangent        rotation vector, rad, body frame: x·Exp(v)
// Matrix form    3×3 rotation matrix; hat(v) is the cross-product matrix [v]
// Action         on points of R^3
// Identity       (0, 0, 0, 1)
// Metric         distance = rotation angle, bi-invariant, sectional curvature 1/4, injectivity radius pi
// Bad input      NaN in, NaN out; constructors from quaternions normalise; fitToSO3 and checkedFrom… are for data
#pragma once

#include <lie/detail/chordal.hpp>
#include <lie/detail/arccosine.hpp>
#include <lie/detail/group_base.hpp>
#include <lie/detail/nearest_rotation.hpp>
#include <lie/manifold.hpp>

#include <concepts>
#include <optional>

namespace liestat {
namespace detail {

/// Mathematics of SO(3) on quaternions (x, y, z, w).
template <class S>
struct So3Math {
  using Scalar = S;
  static constexpr int DoF = 3, num_parameters = 4, N = 3, Dim = 3;
  using Params = Eigen::Matrix<S, 4, 1>;
  using Tangent = Eigen::Matrix<S, 3, 1>;
  using Point = Eigen::Matrix<S, 3, 1>;
  using MatrixType = Eigen::Matrix<S, 3, 3>;

  static Params identity() { return Params(S(0), S(0), S(0), S(1)); }

  /// The quaternions' product, not renormalised.
  static Params quaternionProduct(const Params& a, const Params& b) {
#if defined(__GNUC__) && defined(__AVX__)
    if constexpr (std::is_same_v<S, double>) {
      Params q;
      quaternionProductInLanes(a.data(), b.data(), q.data());
      return q;
    }
#elif defined(EIGEN_VECTORIZE_SSE)
    return (Eigen::Map<const Eigen::Quaternion<S>>(a.data()) * Eigen::Map<const Eigen::Quaternion<S>>(b.data()))
        .coeffs();
#endif
    return Params(a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],  //
                  a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],  //
                  a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],  //
                  a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]);
  }
  static Params product(const Params& a, const Params& b) {
    Params q = quaternionProduct(a, b);
    if constexpr (is_single_precision<S>) {
      // One Newton step of 1/|q|: keeps long chains on the sphere without a square root.
      return q * (S(0.5) * (S(3) - q.dot(q)));
    } else {
      return q;
    }
  }
  static Params inverse(const Params& q) { return Params(-q[0], -q[1], -q[2], q[3]); }
  static Params normalized(const Params& q) {
    using std::sqrt;
    return q / sqrt(q.dot(q));
  }

  // Coordinate by coordinate, here and below: Eigen's expressions read pairs of numbers that have just been stored one by
  // one, for which the processor waits longer than the arithmetic takes.
  static Point act(const Params& q, const Point& p) {
    const S x = q[0], y = q[1], z = q[2], w = q[3], a = p[0], b = p[1], c = p[2];
    const S u = S(2) * (y * c - z * b), v = S(2) * (z * a - x * c), n = S(2) * (x * b - y * a);
    return Point(a + w * u + (y * n - z * v), b + w * v + (z * u - x * n), c + w * n + (x * v - y * u));
  }
  /// The rotated point plus t.
  static Point act(const Params& q, const Point& p, const Point& t) {
    const Point r = act(q, p);
    return Point(r[0] + t[0], r[1] + t[1], r[2] + t[2]);
  }
  static Point linear(const Params& q, const Point& p) { return act(q, p); }
  static Point rotate(const Params& q, const Point& p) { return act(q, p); }
  static MatrixType matrix(const Params& q) {
    return Eigen::Map<const Eigen::Quaternion<S>>(q.data()).toRotationMatrix();
  }

  static Params exp(const Tangent& v) {
    const HalfAngle<S> h = halfAngle(squaredNorm(v));
    const S s = S(0.5) * h.sinc;
#if defined(__GNUC__)
    // Products read quaternions in packets.
    if constexpr (std::is_same_v<S, double>) {
      Params q;
      storeInLanes(s * v[0], s * v[1], s * v[2], h.cos, q.data());
      return q;
    }
#endif
    return Params(s * v[0], s * v[1], s * v[2], h.cos);
  }
  static Tangent log(const Params& q) {
    const Logarithm l = logarithm(q);
    return Tangent(l.scale * q[0], l.scale * q[1], l.scale * q[2]);
  }
  /// log(q) is `scale` times the first three coordinates of q; w is the half-angle's cosine, not negative.
  struct Logarithm {
    S scale, w;
  };
  static EIGEN_ALWAYS_INLINE Logarithm logarithm(const Params& q) {
    // The quaternion may have any norm: products leave it slightly off one.
    const S inverse_norm = inverseNorm(S(q[0] * q[0] + q[1] * q[1] + (q[2] * q[2] + q[3] * q[3])));
    const S signed_inverse = select(q[3] < S(0), S(-inverse_norm), inverse_norm);
    const S w = q[3] * signed_inverse;
    return {S(arccosineRatio(w) * signed_inverse), w};
  }

  static MatrixType hat(const Tangent& v) { return skew(v); }
  static Tangent vee(const MatrixType& m) { return Tangent(m(2, 1), m(0, 2), m(1, 0)); }
  static MatrixType Adj(const Params& q) { return matrix(q); }
  static MatrixType ad(const Tangent& v) { return skew(v); }

  /// leftJacobian(v)·a and leftJacobianInverse(v)·a, without the matrices.
  static Tangent leftJacobianTimes(const Tangent& v, const Tangent& a) {
    const S t = squaredNorm(v), s = halfAngle(t).sinc;
    return crossPolynomialTimes(v, S(S(0.5) * s * s), beta3(t), a);
  }
  static Tangent leftJacobianInverseTimes(const Tangent& v, const Tangent& a) {
    return crossPolynomialTimes(v, S(-0.5), cotangentExcess(squaredNorm(v)), a);
  }
  static MatrixType leftJacobian(const Tangent& v) {
    const S t = squaredNorm(v);
    const S s = halfAngle(t).sinc;
    return rotationPolynomial(v, S(1), S(S(0.5) * s * s), beta3(t));
  }
  static MatrixType leftJacobianInverse(const Tangent& v) {
    return rotationPolynomial(v, S(1), S(-0.5), cotangentExcess(squaredNorm(v)));
  }
  /// ∂(q·exp(d))/∂d on parameters: half of d's product with q.
  static Eigen::Matrix<S, 4, 3> productJacobian(const Params& q) {
    Eigen::Matrix<S, 4, 3> J;
    J << q[3], -q[2], q[1],  //
        q[2], q[3], -q[0],   //
        -q[1], q[0], q[3],   //
        -q[0], -q[1], -q[2];
    return S(0.5) * J;
  }
  /// ∂log(q⁻¹x)/∂x at x = q; its columns are orthogonal.
  static Eigen::Matrix<S, 3, 4> quotientJacobian(const Params& q) { return S(4) * productJacobian(q).transpose(); }
  template <class Generator>
  static Params sampleUniform(Generator& generator) {
    return uniformQuaternion<S>(generator);
  }
  /// log det of the exponential's Jacobian, 2 log(sin(θ/2)/(θ/2)), with its gradient and Hessian
  /// (docs/theory/means.md, section 4.3).
  static VolumeElement<S, 3> logVolume(const Tangent& v) {
    using std::log;
    const S t = v.dot(v), c = S(-2) * cotangentExcess(t);
    return {S(2) * log(halfAngle(t).sinc), c * v,
            c * MatrixType::Identity() - S(2) * cotangentExcessSlope(t) * v * v.transpose()};
  }
  /// Derivative of rightJacobianInverse(v)·a with respect to v, a constant (docs/theory/means.md, section 4.2, M₊); a
  /// row of leftJacobianInverse follows with the sign of the first-order term changed.
  static MatrixType inverseJacobianSlope(const Tangent& v, const Tangent& a, const S& sign) {
    const S t = v.dot(v);
    const S c = cotangentExcess(t);
    const Tangent va = v.cross(a);
    return S(-0.5) * sign * skew(a) - c * (skew(va) + rotationProduct(v, a)) +
           cotangentExcessSlope(t) * v.cross(va) * v.transpose();
  }

 private:
  /// [v][a] = a vᵀ - (v·a) I
  static MatrixType rotationProduct(const Tangent& v, const Tangent& a) {
    MatrixType m = a * v.transpose();
    m.diagonal().array() -= S(v.dot(a));
    return m;
  }
};

}  // namespace detail

/// Interface of SO3 over owned or viewed memory.
template <class Derived>
class SO3Base : public detail::GroupBase<Derived> {
  using Base = detail::GroupBase<Derived>;

 public:
  using typename Base::Scalar, typename Base::Plain, typename Base::Math, typename Base::Tangent;
  using Quaternion = Eigen::Quaternion<Scalar>;
  using Base::operator*;
  template <class Other>
  using SO3Product = typename Base::template GroupProduct<Other>;

  /// A rotation vector and its norm (rad).
  struct TangentAndTheta {
    Tangent tangent;
    Scalar theta;
  };
  TangentAndTheta logAndTheta() const {
    const Tangent v = this->log();
    return {v, detail::norm(v)};
  }
  /// exp(v); *theta becomes the norm of v.
  static Plain expAndTheta(const Tangent& v, Scalar* theta) {
    *theta = detail::norm(v);
    return Base::exp(v);
  }

  /// The quaternion, viewed in place.
  Eigen::Map<const Quaternion> unit_quaternion() const { return Eigen::Map<const Quaternion>(this->data()); }
  /// Replaces the rotation by that of a quaternion of any positive norm.
  void setQuaternion(const Quaternion& q) { this->derived().mutableStorage() = Math::normalized(q.coeffs()); }
  /// Same as matrix().
  Eigen::Matrix<Scalar, 3, 3> rotationMatrix() const { return this->matrix(); }
  /// The angle in [0, pi] (rad) and the axis; the axis is x where there is no rotation.
  Eigen::AngleAxis<Scalar> angleAxis() const {
    const Tangent v = this->log();
    const Scalar angle = detail::norm(v);
    const auto turns = angle > Scalar(0);
    const Tangent u = v / detail::select(turns, angle, Scalar(1));
    return Eigen::AngleAxis<Scalar>(angle, Tangent(detail::select(turns, u[0], Scalar(1)), u[1], u[2]));
  }
  /// Angle of the rotation about the x axis that is closest to this one, rad in (-pi, pi].
  Scalar angleX() const { return closestAngle(0); }
  Scalar angleY() const { return closestAngle(1); }
  Scalar angleZ() const { return closestAngle(2); }

 private:
  Scalar closestAngle(int axis) const {
    const Eigen::Matrix<Scalar, 3, 3> R = this->matrix();
    const int j = (axis + 1) % 3, k = (axis + 2) % 3;
    using std::atan2;
    return atan2(Scalar(R(k, j) - R(j, k)), Scalar(R(j, j) + R(k, k)));
  }
};

/// A rotation of R^3; see the header comment.
template <class Scalar_, int Options_ = 0>
class SO3;

using SO3d = SO3<double>;
using SO3f = SO3<float>;

}  // namespace liestat

LIESTAT_TRAITS(SO3, liestat::detail::So3Math)

namespace liestat {

template <class Scalar_, int Options_>
class SO3 : public SO3Base<SO3<Scalar_, Options_>> {
  LIESTAT_OWNER(SO3, SO3Base);

 public:
  using Quaternion = Eigen::Quaternion<Scalar_>;
  using Matrix3 = Eigen::Matrix<Scalar_, 3, 3>;
  using Tangent = Eigen::Matrix<Scalar_, 3, 1>;

  /// From a quaternion of any positive norm, which is normalised; a zero quaternion gives NaN.
  template <class D>
  explicit SO3(const Eigen::QuaternionBase<D>& q) : storage_(Shell::Math::normalized(q.coeffs())) {}
  /// From an angle (rad) about an axis of norm one.
  explicit SO3(const Eigen::AngleAxis<Scalar_>& a) : SO3(Shell::exp(Tangent(a.angle() * a.axis()))) {}
  /// From a rotation matrix, orthogonal up to rounding; largest of the four pivots, so exact near half-turns.
  SO3(const Matrix3& R) : storage_(Shell::Math::normalized(detail::quaternionOf<Scalar_>(R))) {}
  /// The rotation nearest to any matrix in the Frobenius norm, of positive determinant or not.
  static SO3 fitToSO3(const Matrix3& M) { return fromParams(detail::nearestQuaternion<Scalar_>(M)); }
  /// From a rotation matrix read from data: nothing if |RᵀR - I| exceeds the tolerance or det R < 0 or NaN.
  static std::optional<SO3> checkedFromMatrix(const Matrix3& R, Scalar_ tolerance = Scalar_(1e-6)) {
    const Scalar_ defect = (R.transpose() * R - Matrix3::Identity()).norm();
    if (!(defect <= tolerance) || !(R.determinant() > Scalar_(0))) return std::nullopt;
    return SO3(R);
  }
  /// From a quaternion read from data: nothing if its norm differs from one by more than the tolerance, or NaN.
  static std::optional<SO3> checkedFromQuaternion(const Quaternion& q, Scalar_ tolerance = Scalar_(1e-3)) {
    using std::abs;
    if (!(abs(q.norm() - Scalar_(1)) <= tolerance)) return std::nullopt;
    return SO3(q);
  }
  /// Rotations about the axes, angle in rad; rotX(a) equals exp((a, 0, 0)) to the bit.
  static SO3 rotX(const Scalar_& a) { return Shell::exp(Tangent(a, Scalar_(0), Scalar_(0))); }
  static SO3 rotY(const Scalar_& a) { return Shell::exp(Tangent(Scalar_(0), a, Scalar_(0))); }
  static SO3 rotZ(const Scalar_& a) { return Shell::exp(Tangent(Scalar_(0), Scalar_(0), a)); }
};

/// SO(3) is a Riemannian manifold under its own bi-invariant metric.
template <class S, int O>
struct ManifoldTraits<SO3<S, O>> : GroupManifold<SO3<S, O>> {
  using Math = detail::So3Math<S>;
  using Tangent = Eigen::Matrix<S, 3, 1>;
  using Square = Eigen::Matrix<S, 3, 3>;

  static Tangent metricWeights() { return Tangent::Ones(); }
  static S injectivityRadius() { return S(EIGEN_PI); }
  static S maxSectionalCurvature() { return S(0.25); }
  /// n nᵀ + (θ/2)cot(θ/2)(I - n nᵀ), exact (docs/theory/means.md, section 3.2).
  static Square hessianHalfSquaredDistance(const Tangent& z) {
    return detail::rotationPolynomial(z, S(1), S(0), detail::cotangentExcess(S(z.dot(z))));
  }
  /// ∂(J_r⁻ᵀ(z) a)/∂z
  static Square dlogFeatureTransposed(const Tangent& z, const Tangent& a) {
    return Math::inverseJacobianSlope(z, a, S(-1));
  }
  /// ∂(-J_l⁻ᵀ(z) a)/∂z
  static Square dlogBaseTransposed(const Tangent& z, const Tangent& a) {
    return -Math::inverseJacobianSlope(z, a, S(1));
  }
  static detail::VolumeElement<S, 3> logVolume(const Tangent& z) { return Math::logVolume(z); }

  using ChordalMoments = detail::QuaternionMoments<SO3<S, O>>;
  static constexpr CompactFactor compact_factor = CompactFactor::rotation;
  static constexpr int compact_begin = 0;
  static Eigen::Matrix<S, 4, 1> compactCoordinates(const SO3<S, O>& x) { return x.params(); }
  static const S* parameters(const SO3<S, O>& x) { return x.data(); }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::rotation, 0, 3}};
};

/// A quaternion, view or expression of one, stands for its rotation; its norm does not matter.
template <class Q>
  requires std::derived_from<Q, Eigen::QuaternionBase<Q>>
struct PointTraits<Q> {
  using type = SO3<typename Q::Scalar>;
  static type from(const Q& quaternion) { return type(quaternion); }
};

}  // namespace liestat

LIESTAT_MAPS(SO3, liestat::SO3Base)
