// The residual of one frame over the hemisphere about an estimate: figures 5, 6 and 11.
#pragma once

#include <cli/show/page.hpp>
#include <fusion/motion/types.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <functional>
#include <optional>
#include <span>

namespace liestat::cli {

/// Directions about a centre as points of a plane, in degrees: the tangent coordinates of the great circle from the centre
/// (axes as those of its covariance). A direction of the other hemisphere has those of its antipode.
class HemisphereChart {
 public:
  explicit HemisphereChart(const Eigen::Vector3d& centre) : centre_(centre) {}

  bool holds(const Eigen::Vector3d& direction) const { return direction.dot(centre_.unit_vector()) >= 0; }
  Eigen::Vector2d operator()(const Eigen::Vector3d& direction) const;
  Eigen::Vector3d direction(const Eigen::Vector2d& coordinates) const;

 private:
  S2d centre_;
};

/// A residual, even in the direction, of the pairs that are used.
struct DirectionResidual {
  std::function<double(const Eigen::Vector3d&)> cost;  ///< χ²
  double degrees_of_freedom = 1;
};
/// The subspace constraint's with the rotation eliminated; Flow::discrete: the essential constraint's, least over rotations.
DirectionResidual residualOf(std::span<const PointPair> pairs, Flow flow, const SO3d& near);
/// The essential constraint's at one rotation.
DirectionResidual residualAtRotation(std::span<const PointPair> pairs, const SO3d& rotation);

/// The residual over a hemisphere, per degree of freedom.
struct ResidualMap {
  Grid grid;                                        ///< degrees; NaN beyond the hemisphere
  Eigen::Vector2d least = Eigen::Vector2d::Zero();  ///< degrees
  double least_residual = 0;                        ///< there
  std::optional<Eigen::Matrix2d> covariance;        ///< degrees², from the curvature there; none if it has none
  std::vector<Eigen::Vector2d> others;              ///< other local minima, on the grid
};
ResidualMap residualMap(const DirectionResidual& residual, const HemisphereChart& chart);

}  // namespace liestat::cli
