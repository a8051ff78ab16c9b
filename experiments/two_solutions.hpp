#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <experiments/inertial_scene.hpp>

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <vector>

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

/// One of the solutions, as fields.
struct SolutionOfTwo {
  const TwoSolutions* found = nullptr;
  std::size_t k = 0;
};
template <class V>
void describe(V& v, const SolutionOfTwo& x) {
  const ClosedFormSolution s = x.found == nullptr ? ClosedFormSolution{} : x.found->result.solutions[x.k];
  v("truth", x.found != nullptr && x.k == x.found->truth)("velocity", s.velocity, "", "m/s");
  v("gravity", s.gravity, "", "m/s^2")("roll", s.roll(), "", "rad")("pitch", s.pitch(), "", "rad")("cost", s.cost);
  Eigen::MatrixXd features(static_cast<Eigen::Index>(s.features.size()), 3);
  for (Eigen::Index i = 0; i < features.rows(); ++i) features.row(i) = s.features[static_cast<std::size_t>(i)];
  v("negative_depths", s.negative_depths)("features", features, "", "m");
}
template <class V>
void describe(V& v, const TwoSolutions& found) {
  v("figure", found.figure)("scene_seed", found.seed)("images", found.scene.times.size());
  v("features", found.scene.features.size())("times", found.scene.times, "", "s");
  v("status", name(found.result.status))("null_dimension", found.result.null_dimension);
  v("singular_values", found.result.singular_values)("features_scale", measuredScale(found));
  v("axes", "body at the first image");
  std::vector<SolutionOfTwo> solutions;
  for (std::size_t k = 0; k < found.result.solutions.size(); ++k) solutions.push_back({&found, k});
  v("solutions", solutions);
}

/// Where the body is at a time according to a solution: in its axes at the first image, from there (m).
Eigen::Vector3d positionAt(const InertialScene& scene, const ClosedFormSolution& solution, double t);

/// The distance of the farthest feature or position of a solution from the first position (m).
double extent(const InertialScene& scene, const ClosedFormSolution& solution);

}  // namespace liestat::experiments
