// The interface that every group shares, over the stateless mathematics of its own header.
#pragma once

#include <lie/detail/shell.hpp>

#include <ostream>

namespace liestat::detail {

/// Members of every group G with tangent dimension DoF. Tangent order: translation first, then rotation. Perturbations
/// are on the right: x·Exp(v).
template <class Derived>
class GroupBase : public Shell<Derived> {
  using Base = Shell<Derived>;

 public:
  using Base::DoF, Base::num_parameters, Base::params;
  using typename Base::Math, typename Base::Params, typename Base::Plain, typename Base::Scalar, typename Base::Tangent;
  using Adjoint = Eigen::Matrix<Scalar, DoF, DoF>;
  /// Homogeneous or rotation matrix, and the matrix of hat.
  using Transformation = typename Math::MatrixType;
  static constexpr int N = Math::N;      ///< rows of matrix()
  static constexpr int Dim = Math::Dim;  ///< dimension of the points that the group acts on
  using Point = Eigen::Matrix<Scalar, Dim, 1>;

  /// Group product; no square root is taken: call normalize() after long chains of products.
  template <class Other>
  Plain operator*(
      const GroupBase<Other>& other) const requires std::is_same_v<typename ShellTraits<Other>::Math, Math> {
    return Plain::fromParams(Math::product(params(), other.params()));
  }
  template <class Other>
  Derived& operator*=(const GroupBase<Other>& other) {
    this->derived().mutableStorage() = Math::product(params(), other.params());
    return this->derived();
  }
  /// Action on a point of R^Dim.
  template <class D>
  Point operator*(const Eigen::MatrixBase<D>& point) const
      requires(D::RowsAtCompileTime == Dim && D::ColsAtCompileTime == 1) {
    return Math::act(params(), Point(point));
  }
  Plain inverse() const { return Plain::fromParams(Math::inverse(params())); }
  /// Tangent vector v with exp(v) = *this, rotation angle in [0, pi].
  Tangent log() const { return Math::log(params()); }
  /// Group exponential.
  static Plain exp(const Tangent& v) { return Plain::fromParams(Math::exp(v)); }
  Transformation matrix() const { return Math::matrix(params()); }
  /// Adjoint: x·Exp(v)·x⁻¹ = Exp(Adj v).
  Adjoint Adj() const { return Math::Adj(params()); }
  /// Matrix of the Lie bracket: ad(v) w = vee([hat v, hat w]).
  static Adjoint ad(const Tangent& v) { return Math::ad(v); }
  static Transformation hat(const Tangent& v) { return Math::hat(v); }
  static Tangent vee(const Transformation& m) { return Math::vee(m); }
  static Tangent lieBracket(const Tangent& a, const Tangent& b) { return Math::ad(a) * b; }
  /// Exp(v + d) = Exp(leftJacobian(v) d + O(d²))·Exp(v).
  static Adjoint leftJacobian(const Tangent& v) { return Math::leftJacobian(v); }
  /// Inverse of leftJacobian, regular at rotation angle pi, singular at 2 pi.
  static Adjoint leftJacobianInverse(const Tangent& v) { return Math::leftJacobianInverse(v); }
  /// Exp(v + d) = Exp(v)·Exp(rightJacobian(v) d + O(d²)).
  static Adjoint rightJacobian(const Tangent& v) { return Math::leftJacobian(Tangent(-v)); }
  /// Inverse of rightJacobian: Log(Exp(v)·Exp(d)) = v + rightJacobianInverse(v) d + O(d²).
  static Adjoint rightJacobianInverse(const Tangent& v) { return Math::leftJacobianInverse(Tangent(-v)); }
  /// Projects the parameters back on their constraint (unit quaternion or complex number).
  void normalize() { this->derived().mutableStorage() = Math::normalized(params()); }
};

template <class Derived>
std::ostream& operator<<(std::ostream& os, const Shell<Derived>& x) {
  return os << x.params().transpose();
}

}  // namespace liestat::detail
