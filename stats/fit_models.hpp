// Equations and constraints of curves, surfaces and maps, for autoDiff() (stats/auto_diff.hpp) and estimates of a
// user's own; stats/fits.hpp has them with their starts. Coordinates of parameters are those of the fits. Needs Eigen
// alone.
#pragma once

#include <Eigen/Core>

#include <cmath>

namespace liestat {

/// ‖m - c‖² - r² = 0, parameter (c, r): a circle, a sphere.
template <int D>
struct SphereEquation {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, D + 1, 1>& q, const Eigen::Matrix<S, D, 1>& m) const {
    S sum = -q[D] * q[D];
    for (int i = 0; i < D; ++i) sum += (m[i] - q[i]) * (m[i] - q[i]);
    return Eigen::Matrix<S, 1, 1>(sum);
  }
};

/// n·m + d = 0, parameter (n, d): a line of the plane, a plane.
template <int D>
struct HyperplaneEquation {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, D + 1, 1>& q, const Eigen::Matrix<S, D, 1>& m) const {
    S sum = q[D];
    for (int i = 0; i < D; ++i) sum += q[i] * m[i];
    return Eigen::Matrix<S, 1, 1>(sum);
  }
};
/// ‖n‖² = 1.
template <int D>
struct UnitNormal {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, D + 1, 1>& q) const {
    return Eigen::Matrix<S, 1, 1>(q.template head<D>().squaredNorm() - S(1));
  }
};

/// (m - p) × u = 0, parameter (p, u): a line of space. Two of the three equations are independent.
struct Line3Equation {
  static constexpr int rank = 2;
  template <class S>
  Eigen::Matrix<S, 3, 1> operator()(const Eigen::Matrix<S, 6, 1>& q, const Eigen::Matrix<S, 3, 1>& m) const {
    const S x = m[0] - q[0], y = m[1] - q[1], z = m[2] - q[2];
    return {y * q[5] - z * q[4], z * q[3] - x * q[5], x * q[4] - y * q[3]};
  }
};
/// ‖u‖² = 1, p·u = 0.
struct Line3Constraint {
  template <class S>
  Eigen::Matrix<S, 2, 1> operator()(const Eigen::Matrix<S, 6, 1>& q) const {
    return {q[3] * q[3] + q[4] * q[4] + q[5] * q[5] - S(1), q[0] * q[3] + q[1] * q[4] + q[2] * q[5]};
  }
};

/// a x² + b xy + c y² + d x + e y + f = 0.
struct ConicEquation {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 6, 1>& q, const Eigen::Matrix<S, 2, 1>& m) const {
    return Eigen::Matrix<S, 1, 1>(m[0] * (q[0] * m[0] + q[1] * m[1] + q[3]) + m[1] * (q[2] * m[1] + q[4]) + q[5]);
  }
};
/// An ellipse by centre, semi-axes and angle, as fitEllipse() returns it: (u/a)² + (v/b)² = 1 in its axes.
struct EllipseEquation {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 5, 1>& e, const Eigen::Matrix<S, 2, 1>& m) const {
    using std::cos, std::sin;
    const S c = cos(e[4]), s = sin(e[4]), x = m[0] - e[0], y = m[1] - e[1];
    const S u = (c * x + s * y) / e[2], v = (c * y - s * x) / e[3];
    return Eigen::Matrix<S, 1, 1>(u * u + v * v - S(1));
  }
};
/// ‖q‖² = 1, of N numbers.
template <int N>
struct UnitLength {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, N, 1>& q) const {
    return Eigen::Matrix<S, 1, 1>(q.squaredNorm() - S(1));
  }
};

/// x₂ (h₃·x₁) = h₁·x₁, y₂ (h₃·x₁) = h₂·x₁ of a match (x₁, y₁, x₂, y₂); H row by row.
struct HomographyEquation {
  template <class S>
  Eigen::Matrix<S, 2, 1> operator()(const Eigen::Matrix<S, 9, 1>& h, const Eigen::Matrix<S, 4, 1>& m) const {
    const S scale = h[6] * m[0] + h[7] * m[1] + h[8];
    return {h[0] * m[0] + h[1] * m[1] + h[2] - m[2] * scale, h[3] * m[0] + h[4] * m[1] + h[5] - m[3] * scale};
  }
};

/// x₂ᵀ F x₁ = 0 of a match (x₁, y₁, x₂, y₂); F row by row.
struct EpipolarEquation {
  template <class S>
  Eigen::Matrix<S, 1, 1> operator()(const Eigen::Matrix<S, 9, 1>& f, const Eigen::Matrix<S, 4, 1>& m) const {
    return Eigen::Matrix<S, 1, 1>(m[2] * (f[0] * m[0] + f[1] * m[1] + f[2]) +
                                  m[3] * (f[3] * m[0] + f[4] * m[1] + f[5]) + f[6] * m[0] + f[7] * m[1] + f[8]);
  }
};
/// ‖F‖² = 1, det F = 0.
struct FundamentalConstraint {
  template <class S>
  Eigen::Matrix<S, 2, 1> operator()(const Eigen::Matrix<S, 9, 1>& f) const {
    return {f.squaredNorm() - S(1), f[0] * (f[4] * f[8] - f[5] * f[7]) - f[1] * (f[3] * f[8] - f[5] * f[6]) +
                                        f[2] * (f[3] * f[7] - f[4] * f[6])};
  }
};

}  // namespace liestat
