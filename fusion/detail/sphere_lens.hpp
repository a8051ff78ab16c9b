#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>

// Lenses whose undistorted image of a point (x, y, z) is (x, y) / D(x, y, z), D of degree one and the same all round the
// axis: fisheye and mirror models with a closed inverse. No allocation, no exceptions; NaN has neither image nor inverse.

namespace liestat::detail {

/// The unified model of a mirror, the double sphere, or the extended unified model.
struct SphereLens {
  enum Kind { unified, double_sphere, extended };
  Kind kind;
  double a;      ///< unified and double sphere: ξ; extended: α
  double b = 0;  ///< double sphere: α; extended: β

  /// D at the angle off the axis whose sine and cosine are s and c, and its derivative by that angle.
  struct Divisor {
    double value, slope;
  };
  Divisor divisor(double s, double c) const {
    if (kind == unified) return {c + a, -s};
    if (kind == double_sphere) {
      const double k = a + c, d = std::hypot(s, k);
      return {b * d + (1 - b) * k, -b * a * s / d - (1 - b) * s};
    }
    const double d = std::sqrt(b * s * s + c * c);
    return {a * d + (1 - a) * c, a * (b - 1) * s * c / d - (1 - a) * s};
  }
  /// The distance from the axis is s / D. It grows with the angle where this is positive; beyond, the image folds over.
  double growth(double s, double c) const {
    const Divisor D = divisor(s, c);
    return c * D.value - s * D.slope;
  }
  /// True if a direction is on the sheet around the axis: in front of the fold, with a positive divisor.
  bool reaches(double s, double c) const { return divisor(s, c).value > 0 && growth(s, c) > 0; }
  /// The direction of an undistorted point, of any length; none beyond the image's edge.
  std::optional<Eigen::Vector3d> inverse(const Eigen::Vector2d& m) const {
    const double r2 = m.squaredNorm();
    if (kind == unified) {
      const double root = 1 + (1 - a * a) * r2;
      if (!(root >= 0)) return std::nullopt;
      const double f = (a + std::sqrt(root)) / (1 + r2);
      return Eigen::Vector3d(f * m.x(), f * m.y(), f - a);
    }
    const double alpha = kind == double_sphere ? b : a, beta = kind == double_sphere ? 1 : b;
    const double root = 1 - (2 * alpha - 1) * beta * r2;
    if (!(root >= 0)) return std::nullopt;
    const double z = (1 - beta * alpha * alpha * r2) / (alpha * std::sqrt(root) + 1 - alpha);
    if (kind == extended) return Eigen::Vector3d(m.x(), m.y(), z);
    const double inner = z * z + (1 - a * a) * r2;
    if (!(inner >= 0)) return std::nullopt;
    const double f = (z * a + std::sqrt(inner)) / (z * z + r2);
    return Eigen::Vector3d(f * m.x(), f * m.y(), f * z - a);
  }
};

}  // namespace liestat::detail
