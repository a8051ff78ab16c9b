// The direction of translation by search over the sphere: the residual of the subspace constraint at each direction of a
// lattice (D. Heeger and A. Jepson, "Subspace methods for recovering rigid motion I", IJCV 7, 1992), which the filter of
// Soatto and Perona 1994 replaces. For comparison, and for pictures of the residual.
#pragma once

#include <fusion/motion/subspace_update.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <limits>
#include <numbers>
#include <span>
#include <vector>

namespace liestat {

/// |P ẋ|² in units of the noise: the least Σ w e² over all rotations, or with the prior's share. `rows` is scratch as long
/// as points. NaN where the rotation is not determined.
inline double subspaceCost(std::span<const FlowPoint<double>> points, const Eigen::Vector3d& V,
                           std::span<FlowRow<double>> rows, const RotationPrior<double>& prior = {}) {
  flowRows<double>(points, V, rows);
  const FlowRotationSums<double> sums = rotationSums<double>(rows);
  const Eigen::Vector3d Omega = sums.solve(prior), d = Omega - prior.mean;
  double cost = d.dot(prior.information * d);
  for (const FlowRow<double>& row : rows) {
    const double e = row.q - (row.h0 * Omega[0] + row.h1 * Omega[1] + row.h2 * Omega[2]);
    cost += row.weight * e * e;
  }
  return cost;
}

/// The essential filter's residual: Σ w e² of the epipolar constraint for the motion X₂ = R X₁ + T, with Sampson's
/// normalisation (Flow::discrete). Pairs that R turns out of sight are left out.
inline double essentialCost(std::span<const PointPair> pairs, const SO3d& R, const Eigen::Vector3d& T) {
  const Eigen::Matrix3d matrix = R.matrix();
  double cost = 0;
  for (const PointPair& pair : pairs) {
    const FlowPoint<double> p = flowAfter(matrix, pair);
    if (!std::isfinite(p.x)) continue;
    const FlowRow<double> row = flowRow(p, T);
    cost += row.weight * row.q * row.q;
  }
  return cost;
}

/// A rotation with the least essentialCost() at a direction, and that cost.
struct EssentialMinimum {
  SO3d rotation;
  double cost = std::numeric_limits<double>::quiet_NaN();
};

/// The same with the rotation eliminated, by Gauss-Newton from `start` with steps halved that do not lower the cost. NaN
/// where the rotation is not determined.
inline EssentialMinimum essentialCostOverRotations(std::span<const PointPair> pairs, const Eigen::Vector3d& T,
                                                   const SO3d& start = {}) {
  EssentialMinimum best{start, essentialCost(pairs, start, T)};
  for (int step = 0; step < 20; ++step) {
    const Eigen::Matrix3d matrix = best.rotation.matrix();
    FlowRotationSums<double> sums;
    for (const PointPair& pair : pairs) {
      const FlowPoint<double> p = flowAfter(matrix, pair);
      if (!std::isfinite(p.x)) continue;
      const FlowRow<double> row = flowRow(p, T);
      const Eigen::Vector3d h(row.h0, row.h1, row.h2);
      sums.M += row.weight * h * h.transpose();
      sums.right += row.weight * row.q * h;
    }
    const Eigen::Vector3d Omega = sums.solve({});
    if (!Omega.allFinite()) return {start};
    double scale = 1;
    EssentialMinimum next;
    for (int half = 0; half < 6; ++half, scale *= 0.5) {
      next.rotation = SO3d::exp(Eigen::Vector3d(scale * Omega)) * best.rotation;
      next.cost = essentialCost(pairs, next.rotation, T);
      if (next.cost < best.cost) break;
    }
    if (!(next.cost < best.cost)) break;
    const bool done = best.cost - next.cost <= 1e-6 * best.cost;
    best = next;
    if (done) break;
  }
  return best;
}

/// n directions of a hemisphere, z > 0, in equal areas: a spherical Fibonacci lattice.
inline std::vector<Eigen::Vector3d> hemisphereLattice(std::size_t n) {
  std::vector<Eigen::Vector3d> directions;
  for (std::size_t i = 0; i < n; ++i) {
    const double z = (static_cast<double>(i) + 0.5) / static_cast<double>(n), r = std::sqrt(1 - z * z);
    const double angle = static_cast<double>(i) * std::numbers::pi * (3 - std::sqrt(5.0));
    directions.emplace_back(r * std::cos(angle), r * std::sin(angle), z);
  }
  return directions;
}

struct SphereSearchOptions {
  std::size_t directions = 300;
  Flow flow = Flow::midpoint;  ///< forward or midpoint
  double memory = 1;           ///< share of the costs so far that counts in the next frame; 0: each frame by itself
};

/// The residuals of the lattice, frame after frame; no allocation once the largest frame has been seen.
class SphereSearch {
 public:
  explicit SphereSearch(const SphereSearchOptions& options = {})
      : options_(options), directions_(hemisphereLattice(options.directions)), costs_(directions_.size(), 0.0) {}

  /// The direction of the lattice with the least cost; positive depths decide its sign.
  Eigen::Vector3d update(std::span<const PointPair> pairs) {
    points_.clear();
    for (const PointPair& pair : pairs) points_.push_back(flowOf(pair, options_.flow));
    rows_.resize(points_.size());
    std::size_t best = 0;
    for (std::size_t i = 0; i < directions_.size(); ++i) {
      costs_[i] = options_.memory * costs_[i] + subspaceCost(points_, directions_[i], rows_);
      if (costs_[i] < costs_[best]) best = i;
    }
    flowRows<double>(points_, directions_[best], rows_);
    const Eigen::Vector3d Omega = rotationSums<double>(rows_).solve({});
    double depth = 0;
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const double inverse = rows_[i].inverse_length;
      if (inverse > 0) depth += rows_[i].weight * flowResidual(points_[i], rows_[i], Omega).along / inverse;
    }
    sign_ = options_.memory * sign_ * last_.dot(directions_[best]) + depth;
    last_ = directions_[best];
    return sign_ < 0 ? Eigen::Vector3d(-last_) : last_;
  }
  std::span<const Eigen::Vector3d> directions() const { return directions_; }
  std::span<const double> costs() const { return costs_; }

 private:
  SphereSearchOptions options_;
  std::vector<Eigen::Vector3d> directions_;
  std::vector<double> costs_;
  std::vector<FlowPoint<double>> points_;
  std::vector<FlowRow<double>> rows_;
  Eigen::Vector3d last_ = Eigen::Vector3d::UnitZ();
  double sign_ = 0;
};

}  // namespace liestat
