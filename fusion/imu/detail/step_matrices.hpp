// The coefficients, by its angle, and the vectors of one preintegration step of constant rate and force.
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
    // The rates of a vehicle turn by hundredths of a radian in a sample: six terms are exact for a quarter.
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

/// A step's rotation vector φ and its force in the axes of the start of the interval, and what is made of them.
template <class S>
struct StepVectors {
  using Vector3 = Eigen::Matrix<S, 3, 1>;

  Vector3 phi, force;
  Vector3 once, twice;       ///< φ×f and φ×(φ×f)
  S squared_angle, along;    ///< |φ|², φ·f
  Columns<S> skew, squared;  ///< K = [φ], K²

  StepVectors(const Vector3& rotation_vector, const Vector3& specific_force)
      : phi(rotation_vector),
        force(specific_force),
        once(phi.cross(force)),
        twice(phi.cross(once)),
        squared_angle(phi.dot(phi)),
        along(phi.dot(force)),
        skew(Columns<S>::skew(phi)),
        squared(outer<S>(Columns<S>::column(phi), phi)) {
    squared.addDiagonal(-squared_angle);
  }

  /// m += a I + c K², and m += a I + b K + c K².
  EIGEN_ALWAYS_INLINE void addSymmetric(Columns<S>& m, const S& a, const S& c) const {
    m.addScaled(squared, c);
    m.addDiagonal(a);
  }
  EIGEN_ALWAYS_INLINE void addPolynomial(Columns<S>& m, const S& a, const S& b, const S& c) const {
    addSymmetric(m, a, c);
    m.addScaled(skew, b);
  }
};

}  // namespace liestat::detail
