#pragma once

#include <lie/detail/small_columns.hpp>

#include <Eigen/Core>

namespace liestat::detail {

/// The matrices of one preintegration step of constant rate and force, for one rotation vector φ: polynomials in
/// K = [φ], and derivatives of the integrated force by φ.
template <class S>
class StepMatrices {
 public:
  using Vector3 = Eigen::Matrix<S, 3, 1>;
  using Column = typename Columns<S>::Column;

  StepMatrices(const Vector3& phi, const Vector3& force)
      : phi_(phi), force_(force), t_(phi.dot(phi)), skew_(Columns<S>::skew(phi)) {}

  /// a I + b K + c K².
  Columns<S> polynomial(const S& a, const S& b, const S& c) const {
    Columns<S> m = outer<S>(Columns<S>::column(phi_) * c, phi_);
    m += skew_ * b;
    m.addDiagonal(a - c * t_);
    return m;
  }
  /// ∂(k0 f + k1 φ×f + k2 φ×(φ×f))/∂φ for coefficients k1, k2 that are functions of |φ| with slopes q1, q2 (derivative
  /// over |φ|), f the force.
  Columns<S> slope(const S& k1, const S& k2, const S& q1, const S& q2) const {
    const Vector3 w = phi_.cross(force_), ww = phi_.cross(w);
    // d/dφ of φ×(φ×f) = φ (φ·f) - f |φ|² is (φ·f) I + φ fᵀ - 2 f φᵀ.
    Columns<S> m = outer<S>(Columns<S>::column(Vector3(q1 * w + q2 * ww - (S(2) * k2) * force_)), phi_);
    m += outer<S>(Columns<S>::column(phi_) * k2, force_);
    m -= Columns<S>::skew(force_) * k1;
    m.addDiagonal(k2 * phi_.dot(force_));
    return m;
  }
  const S& squaredAngle() const { return t_; }

 private:
  Vector3 phi_, force_;
  S t_;
  Columns<S> skew_;
};

}  // namespace liestat::detail
