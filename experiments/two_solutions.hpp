#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <experiments/inertial_scene.hpp>

#include <Eigen/Core>

#include <cstdint>
#include <optional>

namespace liestat::experiments {

/// A scene with two solutions, as figures 1 and 2 of Martinelli (2012) show: a feature in four images, and three
/// features in seven images of a constant acceleration.
struct TwoSolutions {
  int figure = 1;
  std::uint64_t seed = 0;
  InertialScene scene;
  ClosedFormResult result;
  std::size_t truth = 0;  ///< which of the two it is
};

/// The figure's scene: the first one from this seed on of which the closed form finds both solutions with all features
/// in front of the camera, and which can be drawn (positions and features of both within some metres, and not upon each
/// other). None among a thousand: empty.
std::optional<TwoSolutions> twoSolutions(int figure, std::uint64_t seed);

/// The second solution's lengths over the first's: the mean of the features'.
double measuredScale(const TwoSolutions& found);

/// Where the body is at a time according to a solution: in its axes at the first image, from there (m).
Eigen::Vector3d positionAt(const InertialScene& scene, const ClosedFormSolution& solution, double t);

/// The distance of the farthest feature or position of a solution from the first position (m).
double extent(const InertialScene& scene, const ClosedFormSolution& solution);

}  // namespace liestat::experiments
