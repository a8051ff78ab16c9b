#include <experiments/two_solutions.hpp>

#include <fusion/init/closed_form.hpp>

#include <algorithm>
#include <cstddef>
#include <utility>

namespace liestat::experiments {
namespace {

using Vector3 = Eigen::Vector3d;

/// Twice integrated force at any time, from the true motion.
Vector3 displacementAt(const InertialScene& scene, double t) {
  const SO3d body_R_world = scene.attitude(0).inverse();
  return body_R_world * Vector3(scene.position(t) - scene.position(0)) - t * scene.velocity -
         0.5 * t * t * scene.gravity;
}

InertialSceneOptions optionsOf(int figure) {
  if (figure == 1) return {.images = 4, .features = 1, .acceleration = 3};
  return {.images = 7, .features = 3, .motion = SceneMotion::constant_acceleration, .acceleration = 1.5};
}

/// True if both solutions can be read off one drawing: of similar size, with paths and features apart.
bool canBeDrawn(const InertialScene& scene, const ClosedFormResult& r) {
  const ClosedFormSolution &a = r.solutions[0], &b = r.solutions[1];
  const double size = std::max(extent(scene, a), extent(scene, b));
  const double ratio = extent(scene, a) / extent(scene, b);
  const double end = scene.times.back();
  const double apart = (positionAt(scene, a, end) - positionAt(scene, b, end)).norm();
  const double moved = std::min(positionAt(scene, a, end).norm(), positionAt(scene, b, end).norm());
  return size < 9 && ratio > 0.4 && ratio < 2.5 && apart > 0.15 * size && moved > 0.25 * size &&
         (a.features[0] - b.features[0]).norm() > 0.15 * size;
}

}  // namespace

Vector3 positionAt(const InertialScene& scene, const ClosedFormSolution& s, double t) {
  return t * s.velocity + 0.5 * t * t * s.gravity + displacementAt(scene, t);
}

double extent(const InertialScene& scene, const ClosedFormSolution& s) {
  double far = 0;
  for (const Vector3& P : s.features) far = std::max(far, P.norm());
  for (const double t : scene.times) far = std::max(far, positionAt(scene, s, t).norm());
  return far;
}

std::optional<TwoSolutions> twoSolutions(int figure, std::uint64_t seed) {
  for (std::uint64_t i = 0; i < 1000; ++i) {
    InertialScene scene(optionsOf(figure), seed + i);
    ClosedFormResult result = solveClosedForm(scene.window);
    if (result.status != FusionStatus::ambiguous || result.solutions.size() != 2) continue;
    if (!canBeDrawn(scene, result)) continue;
    const auto off = [&](std::size_t k) { return (result.solutions[k].velocity - scene.velocity).norm(); };
    const std::size_t truth = off(0) <= off(1) ? 0 : 1;
    return TwoSolutions{figure, seed + i, std::move(scene), std::move(result), truth};
  }
  return {};
}

double measuredScale(const TwoSolutions& found) {
  double sum = 0;
  const auto &a = found.result.solutions[0].features, &b = found.result.solutions[1].features;
  for (std::size_t i = 0; i < a.size(); ++i) sum += b[i].norm() / a[i].norm();
  return sum / static_cast<double>(a.size());
}

}  // namespace liestat::experiments
