// Linear least squares for a vector of R³ of known length: all local minima of |R x + r|² on |x| = radius. Gravity in a
// visual-inertial initialisation is such a vector.
//
// With R = U diag(s) Vᵀ, l = s² ascending and e = -s Uᵀr, the stationary points are V (l + λ)⁻¹ e with Σ e²/(l + λ)² =
// radius². The global minimum is the only root λ ≥ -l₁; at most one other minimum exists, the root in (-l₂, -l₁)
// nearest to -l₁ (J. M. Martínez, "Local minimizers of quadratic functions on Euclidean balls and spheres", SIAM J.
// Optim. 4, 1994). The unknown is μ = l₁ + λ, with gaps l_k - l₁ = (s_k - s₁)(s_k + s₁), so that no digits of μ
// cancel if a singular value is zero. Derivation: docs/theory/visual_inertial.md, section 3.2.
#pragma once

#include <lie/detail/small_orthogonal.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat {

/// The minima of least squares on a sphere, the global one first. Input that is not finite gives count = 0.
struct SphereMinima {
  Eigen::Vector3d point[2] = {Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  double cost[2] = {0, 0};       ///< |R x + r|²
  double curvature[2] = {0, 0};  ///< μ, the least eigenvalue of RᵀR + λ; ≥ 0 at the global minimum
  int count = 0;                 ///< 1, or 2 where a second local minimum exists
  Eigen::Vector3d values = Eigen::Vector3d::Zero();          ///< singular values of R, ascending
  Eigen::Matrix3d directions = Eigen::Matrix3d::Identity();  ///< right singular vectors, in the order of the values
};

namespace detail {

/// The stationary point x(μ) in the basis of R's right singular vectors.
struct SecularPoint {
  Eigen::Vector3d gap, e;  ///< l_k - l₁; e

  Eigen::Vector3d at(double mu) const {
    Eigen::Vector3d x;
    // 0/0: the data do not determine this coordinate, and zero keeps x shortest.
    for (int k = 0; k < 3; ++k) x[k] = e[k] == 0 ? 0 : e[k] / (gap[k] + mu);
    return x;
  }
  /// ½ d|x|²/dμ.
  double slope(double mu) const {
    double sum = 0;
    for (int k = 0; k < 3; ++k) {
      if (e[k] != 0) sum -= e[k] * e[k] / ((gap[k] + mu) * (gap[k] + mu) * (gap[k] + mu));
    }
    return sum;
  }
};

/// The root μ > 0 by Newton's method on 1/|x| - 1/radius, safeguarded by its bracket.
inline double globalRoot(const SecularPoint& secular, double radius) {
  double low = std::abs(secular.e[0]) / radius, high = secular.e.norm() / radius, mu = low > 0 ? low : high;
  for (int i = 0; i < 200 && low < high; ++i) {
    const double norm = secular.at(mu).norm();
    (norm > radius ? low : high) = mu;
    // d(1/|x|)/dμ = -slope/|x|³.
    double next = mu + (norm / radius - 1) * norm * norm / -secular.slope(mu);
    if (!(next > low && next < high)) {
      // The geometric mean, because the root may lie decades above the lower end.
      next = low > 0 ? std::sqrt(low) * std::sqrt(high) : 0.5 * high;
    }
    if (std::abs(next - mu) <= 2 * std::numeric_limits<double>::epsilon() * mu || next == mu) return next;
    mu = next;
  }
  return mu;
}

/// The root in (-gap₂, 0) nearest to 0, or 0 if there is none. |x|² is convex there, so Newton's method does not overshoot
/// the root if it starts between the root and 0.
inline double localRoot(const SecularPoint& secular, double radius) {
  double mu = -std::abs(secular.e[0]) / radius;
  for (int i = 0; i < 400; ++i) {
    if (!(mu > -secular.gap[1])) return 0;
    const double excess = secular.at(mu).squaredNorm() - radius * radius, slope = secular.slope(mu);
    if (!(slope > 0)) return 0;
    const double next = mu - excess / (2 * slope);
    if (excess <= 0 || std::abs(next - mu) <= 2 * std::numeric_limits<double>::epsilon() * std::abs(mu)) {
      return secular.slope(next) > 0 && next > -secular.gap[1] ? next : mu;
    }
    mu = next;
  }
  return 0;  // converging slowly to a minimum of |x|² above radius²: no root
}

}  // namespace detail

/// The minima of |R x + r|² on the sphere of the given radius > 0; none (count = 0) for bad input.
inline SphereMinima minimiseOnSphere(const Eigen::Matrix3d& R, const Eigen::Vector3d& r, double radius) {
  SphereMinima result;
  if (!R.allFinite() || !r.allFinite() || !(radius > 0) || !std::isfinite(radius)) return result;
  const detail::SmallSvd svd(detail::SmallMatrix::of<3, 3>(R));
  detail::SecularPoint secular;
  for (int k = 0; k < 3; ++k) {
    // SmallSvd sorts descending.
    result.values[k] = svd.value(2 - k);
    const double *u = svd.u.row(2 - k), *v = svd.v.row(2 - k);
    result.directions.col(k) = Eigen::Vector3d(v[0], v[1], v[2]);
    secular.e[k] = -result.values[k] * (u[0] * r[0] + u[1] * r[1] + u[2] * r[2]);
  }
  const Eigen::Vector3d& s = result.values;
  for (int k = 0; k < 3; ++k) secular.gap[k] = (s[k] - s[0]) * (s[k] + s[0]);

  const auto keep = [&](const Eigen::Vector3d& x, double mu) {
    // Normalised, because the last Newton step leaves an error in the length.
    result.point[result.count] = radius * (result.directions * x).normalized();
    result.cost[result.count] = (R * result.point[result.count] + r).squaredNorm();
    result.curvature[result.count++] = mu;
  };
  // Hard case (e₁ = 0): x₀ ± q₁ √(radius² - |x₀|²) are minima of equal cost.
  const Eigen::Vector3d level = secular.at(0);
  if (secular.e[0] == 0 && level.allFinite() && level.squaredNorm() <= radius * radius) {
    const double side = std::sqrt(radius * radius - level.squaredNorm());
    keep(level + side * Eigen::Vector3d::UnitX(), 0);
    if (side > 0) keep(level - side * Eigen::Vector3d::UnitX(), 0);
    return result;
  }
  const double global = detail::globalRoot(secular, radius);
  keep(secular.at(global), global);
  if (secular.e[0] != 0) {
    const double local = detail::localRoot(secular, radius);
    if (local < 0) keep(secular.at(local), local);
  }
  return result;
}

}  // namespace liestat
