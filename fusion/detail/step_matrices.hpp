// The coefficients, by its angle, and the matrices of one preintegration step of constant rate and force.
#pragma once

#include <lie/detail/small_columns.hpp>
#include <lie/detail/trig.hpp>

#include <Eigen/Core>

#include <cstddef>

namespace liestat::detail {

/// 2 d/dt of Σ (-1)^k t^k/(2k + offset - 2)!, the slopes of (1 - cos θ)/θ² (offset 4) and of its integrals.
template <int offset>
inline constexpr auto slope_series = factorialSeries<14>(offset, [](int k) { return -2 * (k + 1); });
inline constexpr auto beta2_series = factorialSeries<14>(2, [](int) { return 1; });

/// Coefficients of a step by the angle t = θ²: b = (1 - cos θ)/θ², c = (θ - sin θ)/θ³, d = (θ²/2 - 1 + cos θ)/θ⁴, and
/// their derivatives by θ over θ.
template <class S>
struct StepCoefficients {
  S b, c, d, b_slope, c_slope, d_slope;

  explicit StepCoefficients(const S& t) {
    // The rates of a vehicle turn by hundredths of a radian in a sample: five terms are exact for a quarter.
    if (t < S(0.0625)) {
      evaluate<6>(t);
    } else {
      evaluate<14>(t);
    }
  }

 private:
  template <std::size_t terms>
  void evaluate(const S& t) {
    b = evaluatePolynomial<terms>(beta2_series, t);
    c = evaluatePolynomial<terms>(beta3_series, t);
    d = evaluatePolynomial<terms>(beta4_series, t);
    b_slope = evaluatePolynomial<terms>(slope_series<4>, t);
    c_slope = evaluatePolynomial<terms>(slope_series<5>, t);
    d_slope = evaluatePolynomial<terms>(slope_series<6>, t);
  }
};

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
