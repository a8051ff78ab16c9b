#include <cli/show/motion_report_maps.hpp>

#include <cli/show/units.hpp>
#include <fusion/motion/search.hpp>
#include <lie/manifold.hpp>

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

namespace liestat::cli {
namespace {

constexpr double grid_step = 3, not_there = std::numeric_limits<double>::quiet_NaN();  // degrees
constexpr int grid_half = 31;  // one step beyond the hemisphere, so that minima at its rim have all neighbours

/// Half the cost's second derivatives by differences, degrees⁻².
Eigen::Matrix2d curvature(const std::function<double(const Eigen::Vector2d&)>& cost, const Eigen::Vector2d& at) {
  const double h = 0.2;
  const auto f = [&](double x, double y) { return cost(at + h * Eigen::Vector2d(x, y)); };
  const double centre = f(0, 0), cross = 0.25 * (f(1, 1) - f(1, -1) - f(-1, 1) + f(-1, -1));
  Eigen::Matrix2d H;
  H << f(1, 0) + f(-1, 0) - 2 * centre, cross, cross, f(0, 1) + f(0, -1) - 2 * centre;
  return 0.5 / (h * h) * H;
}

}  // namespace

Eigen::Vector2d HemisphereChart::operator()(const Eigen::Vector3d& direction) const {
  const Eigen::Vector3d near = holds(direction) ? direction : Eigen::Vector3d(-direction);
  return degrees * log(centre_, S2d(near));
}

Eigen::Vector3d HemisphereChart::direction(const Eigen::Vector2d& coordinates) const {
  return exp(centre_, Eigen::Vector2d(coordinates / degrees)).unit_vector();
}

DirectionResidual residualOf(std::span<const PointPair> pairs, Flow flow, const SO3d& near) {
  DirectionResidual residual;
  residual.degrees_of_freedom = std::max(static_cast<double>(pairs.size()) - 3, 1.0);
  if (flow == Flow::discrete) {
    residual.cost = [pairs, near](const Eigen::Vector3d& T) { return essentialCostOverRotations(pairs, T, near).cost; };
    return residual;
  }
  const auto points = std::make_shared<std::vector<FlowPoint<double>>>();
  for (const PointPair& pair : pairs) points->push_back(flowOf(pair, flow));
  const auto rows = std::make_shared<std::vector<FlowRow<double>>>(points->size());
  residual.cost = [points, rows](const Eigen::Vector3d& V) { return subspaceCost(*points, V, *rows); };
  return residual;
}

DirectionResidual residualAtRotation(std::span<const PointPair> pairs, const SO3d& rotation) {
  DirectionResidual residual;
  residual.degrees_of_freedom = std::max(static_cast<double>(pairs.size()), 1.0);
  residual.cost = [pairs, rotation](const Eigen::Vector3d& T) { return essentialCost(pairs, rotation, T); };
  return residual;
}

ResidualMap residualMap(const DirectionResidual& residual, const HemisphereChart& chart) {
  const auto cost = [&](const Eigen::Vector2d& at) {
    const double value = residual.cost(chart.direction(at));
    return std::isfinite(value) ? value : std::numeric_limits<double>::infinity();
  };
  ResidualMap map;
  for (int k = -grid_half; k <= grid_half; ++k) {
    map.grid.x.push_back(grid_step * k), map.grid.y.push_back(grid_step * k);
  }
  const std::size_t n = map.grid.x.size();
  Eigen::Vector2d best = Eigen::Vector2d::Zero();
  double least = std::numeric_limits<double>::infinity();
  for (const double y : map.grid.y) {
    for (const double x : map.grid.x) {
      const Eigen::Vector2d at(x, y);
      const double value = at.norm() <= 90 + 1.5 * grid_step ? cost(at) : not_there;
      map.grid.value.push_back(value / residual.degrees_of_freedom);
      if (at.norm() <= 90 && value < least) least = value, best = at;
    }
  }
  const auto isMinimum = [&](std::size_t i, std::size_t j) {
    const double value = map.grid.at(i, j);
    for (const std::size_t b : {j - 1, j, j + 1}) {
      for (const std::size_t a : {i - 1, i, i + 1}) {
        if ((a != i || b != j) && !(map.grid.at(a, b) > value)) return false;
      }
    }
    return true;
  };
  std::vector<Eigen::Vector2d> minima;
  for (std::size_t j = 1; j + 1 < n; ++j) {
    for (std::size_t i = 1; i + 1 < n; ++i) {
      const Eigen::Vector2d at(map.grid.x[i], map.grid.y[j]);
      if (at.norm() <= 90 && at != best && isMinimum(i, j)) minima.push_back(at);
    }
  }
  for (std::size_t k = 0; k < map.grid.value.size(); ++k) {
    if (Eigen::Vector2d(map.grid.x[k % n], map.grid.y[k / n]).norm() >= 90) map.grid.value[k] = not_there;
  }
  // Between the directions of the grid, by ever smaller steps along the axes and diagonals.
  for (double step = 0.5 * grid_step; step > 1e-3;) {
    bool moved = false;
    for (const double x : {-1.0, 0.0, 1.0}) {
      for (const double y : {-1.0, 0.0, 1.0}) {
        const Eigen::Vector2d at = best + step * Eigen::Vector2d(x, y);
        const double value = cost(at);
        if (value < least) least = value, best = at, moved = true;
      }
    }
    if (!moved) step *= 0.5;
  }
  map.least = best, map.least_residual = least / residual.degrees_of_freedom;
  // A minimum at the rim is seen on both sides of it, and one between grid points may be lower at two of them.
  std::vector<Eigen::Vector3d> known{chart.direction(best)};
  for (const Eigen::Vector2d& at : minima) {
    const Eigen::Vector3d V = chart.direction(at);
    const bool is_known = std::any_of(known.begin(), known.end(), [&](const Eigen::Vector3d& other) {
      return std::abs(other.dot(V)) > std::cos(2 * grid_step / degrees);
    });
    if (is_known) continue;
    known.push_back(V), map.others.push_back(at);
  }
  const Eigen::Matrix2d H = curvature(cost, best);
  if (H.allFinite() && H.determinant() > 0 && H.trace() > 0) map.covariance = H.inverse();
  return map;
}

}  // namespace liestat::cli
