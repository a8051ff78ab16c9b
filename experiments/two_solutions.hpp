#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <experiments/inertial_scene.hpp>

#include <cstdint>
#include <optional>
#include <string>

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

/// For people: both solutions in numbers.
std::string formatTwoSolutions(const TwoSolutions& found);

/// A page with the figure.
void writeTwoSolutionsReport(const std::string& directory, const std::string& command_line, const TwoSolutions& found);

}  // namespace liestat::experiments
