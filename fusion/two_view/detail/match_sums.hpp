// Sums over matches: means and second moments about them, in one pass and without cancellation.
#pragma once

#include <Eigen/Core>

#include <cmath>
#include <limits>
#include <span>

namespace liestat::detail {

/// The means of the matched points and what is left about them.
struct CentredMatches {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero(), mean_second = Eigen::Vector2d::Zero();
  /// Σ a aᵀ, Σ b bᵀ and Σ b aᵀ of the first and the second points.
  Eigen::Matrix2d first = Eigen::Matrix2d::Zero(), second = Eigen::Matrix2d::Zero(), mixed = Eigen::Matrix2d::Zero();
  /// True if both images show more than one point: their spread is above rounding.
  bool spread = false;

  explicit CentredMatches(std::span<const Eigen::Vector4d> matches) {
    if (matches.empty()) return;
    const double n = static_cast<double>(matches.size());
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (const Eigen::Vector4d& m : matches) sum += m;
    sum /= n;
    mean = sum.head<2>();
    mean_second = sum.tail<2>();
    for (const Eigen::Vector4d& m : matches) {
      const Eigen::Vector2d a = m.head<2>() - mean, b = m.tail<2>() - mean_second;
      first += a * a.transpose();
      second += b * b.transpose();
      mixed += b * a.transpose();
    }
    // A coordinate is known to its rounding, which grows with its size.
    constexpr double rounding = 16 * std::numeric_limits<double>::epsilon();
    spread = first.trace() > n * rounding * rounding * mean.squaredNorm() &&
             second.trace() > n * rounding * rounding * mean_second.squaredNorm() &&
             std::isfinite(first.trace() + second.trace());
  }
  /// Translation to the mean and scale of Hartley's normalisation: u = mean + point/scale, of mean square 2.
  double scaleOf(const Eigen::Matrix2d& moments, std::size_t n) const {
    return std::sqrt(2 * static_cast<double>(n) / moments.trace());
  }
};

}  // namespace liestat::detail
