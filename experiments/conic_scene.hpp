// Points on an ellipse and points anywhere: the conic as a constrained estimate, as a linear one, and as a model of a
// robust search.
//
// A conic is q·(x², xy, y², x, y, 1) = 0 with ‖q‖ = 1. The ellipse has semi-axes 1 and 0.5; inliers are spread evenly
// in its angle and have the same noise in both coordinates, outliers are uniform on [-1.5, 1.5] × [-1, 1].
#pragma once

#include <stats/constrained.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace liestat::experiments {

using Conic = Eigen::Matrix<double, 6, 1>;

/// (x², xy, y², x, y, 1).
inline Conic conicMonomials(const Eigen::Vector2d& m) {
  return (Conic() << m.x() * m.x(), m.x() * m.y(), m.y() * m.y(), m.x(), m.y(), 1).finished();
}

/// A point lies on the conic.
struct OnConic {
  using Value = Eigen::Matrix<double, 1, 1>;
  Value operator()(const Conic& q, const Eigen::Vector2d& m) const { return Value(q.dot(conicMonomials(m))); }
  EquationDerivatives<1, 6, 2> linearize(const Conic& q, const Eigen::Vector2d& m) const {
    const Conic monomials = conicMonomials(m);
    return {Value(q.dot(monomials)), monomials.transpose(),
            Eigen::RowVector2d(2 * q[0] * m.x() + q[1] * m.y() + q[3], q[1] * m.x() + 2 * q[2] * m.y() + q[4])};
  }
};

/// ‖q‖² = 1.
struct UnitConic {
  using Value = Eigen::Matrix<double, 1, 1>;
  Value operator()(const Conic& q) const { return Value(q.squaredNorm() - 1); }
  ConstraintDerivatives<1, 6> linearize(const Conic& q) const { return {(*this)(q), 2 * q.transpose()}; }
};

using ConicChannel = MeasurementChannel<Eigen::Vector2d, IsotropicNoise<2>, OnConic>;
using ConicEstimator = ConstrainedEstimator<Conic, UnitConic, ConicChannel>;

/// Adds the square of a point's monomials to a normal matrix.
inline void addConicSquare(const Eigen::Vector2d& m, Eigen::Matrix<double, 6, 6>& A) {
  const Conic monomials = conicMonomials(m);
  A += monomials * monomials.transpose();
}
/// The conic with the least qᵀ A q; none where that leaves it open.
inline std::optional<Conic> leastConic(const Eigen::Matrix<double, 6, 6>& A) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> solver(A);
  // Rank below five to rounding.
  if (!(solver.eigenvalues()[1] > 1e-13 * A.trace())) return {};
  return Conic(solver.eigenvectors().col(0));
}
/// The conic with the least Σ (q·monomials)², of five points the one through them.
inline std::optional<Conic> linearConic(std::span<const Eigen::Vector2d> points) {
  Eigen::Matrix<double, 6, 6> A = Eigen::Matrix<double, 6, 6>::Zero();
  for (const Eigen::Vector2d& m : points) addConicSquare(m, A);
  return leastConic(A);
}

/// Points in random order, or where there are no outliers in that of their angles.
struct ConicScene {
  std::vector<Eigen::Vector2d> points, exact;  ///< with noise and without; outliers are the same in both
  std::vector<bool> inlier;

  /// Draws noise, outliers and order from the generator.
  ConicScene(std::size_t inliers, std::size_t outliers, double sigma, CounterRng& rng) {
    for (std::size_t i = 0; i < inliers + outliers; ++i) {
      if (i < inliers) {
        const double angle = 2 * 3.14159265358979323846 * static_cast<double>(i) / static_cast<double>(inliers);
        exact.emplace_back(std::cos(angle), 0.5 * std::sin(angle));
        points.push_back(exact[i] + sigma * rng.normalVector<2>());
      } else {
        const double x = rng.uniform(-1.5, 1.5);
        exact.emplace_back(x, rng.uniform(-1, 1));
        points.push_back(exact[i]);
      }
      inlier.push_back(i < inliers);
    }
    for (std::size_t i = points.size(); outliers > 0 && i > 1; --i) {
      const std::size_t j = std::min(static_cast<std::size_t>(rng.uniform() * static_cast<double>(i)), i - 1);
      std::swap(points[i - 1], points[j]);
      std::swap(exact[i - 1], exact[j]);
      const bool moved = inlier[i - 1];
      inlier[i - 1] = inlier[j], inlier[j] = moved;
    }
  }

  /// The ellipse, of the sign of another conic.
  static Conic truth(const Conic& sign) {
    const Conic q = (Conic() << 1, 0, 4, 0, 0, -1).finished().normalized();
    return q.dot(sign) < 0 ? Conic(-q) : q;
  }
};

/// eᵀ Λ⁺ e of an estimate's error, Λ of rank five with the null space q.
inline double squaredDistanceFromTruth(const ConstrainedResult<Conic>& estimate) {
  const Conic& q = estimate.parameter;
  const Conic error = ConicScene::truth(q) - q, across = error - q * q.dot(error);
  return mahalanobisSquared<double, 6>(across, Eigen::Matrix<double, 6, 6>(estimate.covariance + q * q.transpose()));
}

}  // namespace liestat::experiments
