#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>

// The two polynomial distortion models of fusion/camera.hpp and their inverses. No allocation, no exceptions; NaN has no inverse.

namespace liestat::detail {

/// The radial part of a distortion: r ↦ r (1 + c₁ r² + c₂ r⁴ + …), where r is the distance from the axis on the plane
/// at depth one (radtan) or the angle off the axis (equidistant). At most four coefficients.
class RadialPolynomial {
 public:
  /// The first `count` of four coefficients.
  RadialPolynomial(const Eigen::Vector4d& coefficients, int count) : degree_(count) {
    for (int i = 0; i < degree_; ++i) c_[static_cast<std::size_t>(i) + 1] = coefficients[i];
  }

  double factor(double r) const {
    double sum = 0;
    for (int i = degree_; i >= 0; --i) sum = sum * r * r + c_[static_cast<std::size_t>(i)];
    return sum;
  }
  double value(double r) const { return r * factor(r); }
  double slope(double r) const {
    double sum = 0;
    for (int i = degree_; i >= 0; --i) sum = sum * r * r + (2 * i + 1) * c_[static_cast<std::size_t>(i)];
    return sum;
  }

  /// True if the slope is positive from 0 to r. Decided by the coefficients of the Bernstein form, with bisection where
  /// their signs disagree, so that no dip between samples is missed.
  bool ascendsTo(double r) const {
    std::array<double, 5> b{};
    // The slope as a polynomial of x = (distance/r)² on [0, 1].
    double power = 1;
    for (int i = 0; i <= degree_; ++i) {
      b[static_cast<std::size_t>(i)] = (2 * i + 1) * c_[static_cast<std::size_t>(i)] * power;
      power *= r * r;
    }
    if (!std::isfinite(b[static_cast<std::size_t>(degree_)])) return false;
    std::array<double, 5> form{};
    for (int k = 0; k <= degree_; ++k) {
      for (int i = 0; i <= k; ++i) {
        form[static_cast<std::size_t>(k)] += binomial(k, i) / binomial(degree_, i) * b[static_cast<std::size_t>(i)];
      }
    }
    return positive(form, 0);
  }

  /// The r on the ascending stretch that starts at zero whose value is `wanted`; none if the stretch, or `limit`, ends
  /// before.
  std::optional<double> inverse(double wanted, double limit) const {
    if (wanted == 0) return 0.0;
    double high = std::min(wanted, limit);
    while (high < limit && ascendsTo(high) && value(high) < wanted) high = std::min(2 * high, limit);
    if (!ascendsTo(high)) {
      double ascends = 0;
      for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (ascends + high);
        (ascendsTo(middle) ? ascends : high) = middle;
      }
      high = ascends;
    }
    if (!(value(high) >= wanted)) return std::nullopt;
    // Newton's iteration within a bracket.
    double low = 0, r = std::min(wanted, high);
    for (int i = 0; i < 100; ++i) {
      const double excess = value(r) - wanted;
      (excess > 0 ? high : low) = r;
      double next = r - excess / slope(r);
      if (!(next > low && next < high)) next = 0.5 * (low + high);
      const double step = std::abs(next - r);
      r = next;
      if (step <= 4 * std::numeric_limits<double>::epsilon() * r) break;
    }
    return r;
  }

 private:
  static double binomial(int n, int k) {
    double value = 1;
    for (int i = 0; i < k; ++i) value = value * (n - i) / (i + 1);
    return value;
  }

  /// True if the polynomial with these Bernstein coefficients is positive on [0, 1].
  bool positive(const std::array<double, 5>& form, int depth) const {
    const auto end = form.begin() + degree_ + 1;
    if (std::all_of(form.begin(), end, [](double x) { return x > 0; })) return true;
    // After forty bisections the sign is still open: the slope vanishes here, and the polynomial folds.
    if (!(form[0] > 0) || !(form[static_cast<std::size_t>(degree_)] > 0) || depth == 40) return false;
    std::array<double, 5> left{}, right = form;
    for (int i = 0; i <= degree_; ++i) {
      left[static_cast<std::size_t>(i)] = right[0];
      for (int k = 0; k < degree_ - i; ++k) {
        right[static_cast<std::size_t>(k)] =
            0.5 * (right[static_cast<std::size_t>(k)] + right[static_cast<std::size_t>(k) + 1]);
      }
    }
    return positive(left, depth + 1) && positive(right, depth + 1);
  }

  int degree_ = 0;
  std::array<double, 5> c_{1, 0, 0, 0, 0};
};

/// A distorted point of the plane at depth one, and its derivative by the undistorted point.
struct DistortedPoint {
  Eigen::Vector2d point;
  Eigen::Matrix2d derivative;

  double determinant() const { return derivative(0, 0) * derivative(1, 1) - derivative(0, 1) * derivative(1, 0); }
};

/// Distorts a point of the plane at depth one with k1, k2, p1, p2, and k3.
inline DistortedPoint distortRadtan(const Eigen::Vector4d& c, const Eigen::Vector2d& m, double k3 = 0) {
  const double x = m.x(), y = m.y(), r2 = x * x + y * y;
  const double factor = 1 + r2 * (c[0] + r2 * (c[1] + r2 * k3));
  const double by_r2 = c[0] + r2 * (2 * c[1] + 3 * r2 * k3);
  DistortedPoint distorted;
  distorted.point = {x * factor + 2 * c[2] * x * y + c[3] * (r2 + 2 * x * x),
                     y * factor + 2 * c[3] * x * y + c[2] * (r2 + 2 * y * y)};
  const double across = 2 * x * y * by_r2 + 2 * c[2] * x + 2 * c[3] * y;
  distorted.derivative << factor + 2 * x * x * by_r2 + 2 * c[2] * y + 6 * c[3] * x, across,  //
      across, factor + 2 * y * y * by_r2 + 2 * c[3] * x + 6 * c[2] * y;
  return distorted;
}

/// Beyond this distance on the plane at depth one (89.99 degrees off the axis) a pinhole is taken to see nothing.
inline constexpr double farthest_on_plane = 5730;

/// The inverse of distortRadtan on the sheet around the axis, where the map is one to one; none outside its image.
inline std::optional<Eigen::Vector2d> undistortRadtan(const Eigen::Vector4d& c, const Eigen::Vector2d& target,
                                                      double k3 = 0) {
  const RadialPolynomial radial({c[0], c[1], k3, 0}, k3 == 0 ? 2 : 3);
  const double distance = target.norm();
  Eigen::Vector2d m = target;
  // The tangential part is small: inverting the radial part alone gives a start within the sheet, where there is one.
  if (const auto r = radial.inverse(distance, farthest_on_plane); r && distance > 0) m *= *r / distance;
  for (int i = 0; i < 50; ++i) {
    const DistortedPoint distorted = distortRadtan(c, m, k3);
    const double determinant = distorted.determinant();
    if (!(determinant > 0)) return std::nullopt;
    const Eigen::Vector2d excess = distorted.point - target;
    const Eigen::Matrix2d& J = distorted.derivative;
    const Eigen::Vector2d step(J(1, 1) * excess.x() - J(0, 1) * excess.y(),
                               J(0, 0) * excess.y() - J(1, 0) * excess.x());
    m -= step / determinant;
    if (step.norm() <= 1e-15 * determinant * (1 + m.norm())) break;
  }
  return m;
}

}  // namespace liestat::detail
