// The cases that the closed form of visual-inertial initialisation distinguishes
// (docs/theory/visual_inertial.md, section 4): motions and layouts, and what must be recognised, on exact data and with
// noise.
//
//   for (const liestat::ClosedFormCase& c : liestat::closedFormCases()) {
//     const liestat::InertialScene scene(c.scene, seed);
//     const auto result = liestat::solveClosedForm(scene.window, {.closed_form = {.estimate_bias = c.bias}});
//     … result.status == c.status || result.status == c.or_status, result.null_dimension == c.null
//   }
#pragma once

#include <fusion/init/closed_form_types.hpp>
#include <experiments/inertial_scene.hpp>

#include <Eigen/Core>

#include <limits>
#include <vector>

namespace liestat::experiments {

/// The factor γ₂ by which the second solution's scene and motion are the first one's scaled, for an acceleration that
/// is constant or seen by three images only: A the specific force (with three images its mean, meanSpecificForce), G
/// gravity (m/s²). The second solution is (γ₂ P, γ₂ (V + L) - L, γ₂ (A + G) - A), L = S₂/dt₂ - A dt₂/2, which is 0 for
/// a constant acceleration. γ₂ = 1: a double root; γ₂ ≤ 0 (|A| ≤ |G|): the second has its features behind the camera. A
/// camera away from the body's origin (p_c) fixes the scale and voids it where the body rotates
/// (docs/theory/visual_inertial.md, section 3.3).
inline double secondSolutionScale(const Eigen::Vector3d& specific_force, const Eigen::Vector3d& gravity) {
  return (specific_force.squaredNorm() - gravity.squaredNorm()) / (specific_force + gravity).squaredNorm();
}

/// The mean specific force in the body's axes at the first image that three images feel: the second divided difference
/// of S at the first, second and third. Any accelerations.
inline Eigen::Vector3d meanSpecificForce(const WindowImage& second, const WindowImage& third) {
  return 2 / (third.time - second.time) * (third.displacement / third.time - second.displacement / second.time);
}

/// A case on exact data: what is asked, and what must come out.
struct ClosedFormCase {
  const char* name;  ///< its own
  InertialSceneOptions scene;
  bool bias = false;  ///< the bias of the accelerometer is an unknown too
  int null = 0;       ///< dimension of the system's null space
  FusionStatus status = FusionStatus::ok;
  FusionStatus or_status = FusionStatus::ok;  ///< the other status that scenes of this row may have
  bool solved = true;                         ///< the truth is among the solutions
};

/// All cases of docs/theory/visual_inertial.md, section 4, and those that its rows stand for.
inline const std::vector<ClosedFormCase>& closedFormCases() {
  using S = FusionStatus;
  using Motion = SceneMotion;
  using Turn = SceneTurn;
  using Layout = SceneLayout;
  using Vector3 = Eigen::Vector3d;
  static const std::vector<ClosedFormCase> list{
      {"n=2, one feature", {.images = 2, .features = 1}, false, 5, S::too_few_images, S::too_few_images, false},
      {"n=2", {.images = 2, .features = 5}, false, 4, S::too_few_images, S::too_few_images, false},
      {"n=3, one feature", {.images = 3, .features = 1}, false, 3, S::too_few_images, S::too_few_images, false},
      {"n=3, two features", {.images = 3, .features = 2}, false, 1, S::ambiguous, S::ok},
      {"n=3", {.images = 3, .features = 6}, false, 1, S::ambiguous, S::ok},
      {"n=4, one feature", {.images = 4, .features = 1}, false, 1, S::ambiguous, S::ok},
      {"n=4", {.images = 4, .features = 2}, false, 0},
      {"n=5, one feature", {.images = 5, .features = 1}, false, 0},
      {"general", {.images = 6, .features = 8}, false, 0},
      {"many", {.images = 11, .features = 12}, false, 0},
      {"constant acceleration, n=3",
       {.images = 3, .features = 3, .motion = Motion::constant_acceleration},
       false,
       1,
       S::ambiguous,
       S::ok},
      {"constant acceleration, n=4, one feature",
       {.images = 4, .features = 1, .motion = Motion::constant_acceleration},
       false,
       1,
       S::ambiguous,
       S::ok},
      {"constant acceleration",
       {.images = 6, .features = 5, .motion = Motion::constant_acceleration},
       false,
       1,
       S::ambiguous,
       S::ok},
      {"constant velocity, n=3",
       {.images = 3, .features = 2, .motion = Motion::constant_velocity},
       false,
       1,
       S::scale_unobservable,
       S::scale_unobservable,
       false},
      {"constant velocity",
       {.images = 6, .features = 5, .motion = Motion::constant_velocity},
       false,
       1,
       S::scale_unobservable,
       S::scale_unobservable,
       false},
      {"constant velocity, n=4, one feature",
       {.images = 4, .features = 1, .motion = Motion::constant_velocity},
       false,
       2,
       S::gravity_undetermined,
       S::gravity_undetermined,
       false},
      {"constant velocity, n=7, one feature",
       {.images = 7, .features = 1, .motion = Motion::constant_velocity},
       false,
       2,
       S::gravity_undetermined,
       S::gravity_undetermined,
       false},
      {"at rest, n=3",
       {.images = 3, .features = 2, .motion = Motion::stationary},
       false,
       2,
       S::stationary,
       S::stationary},
      {"at rest", {.images = 6, .features = 5, .motion = Motion::stationary}, false, 5, S::stationary, S::stationary},
      {"at rest, one feature",
       {.images = 6, .features = 1, .motion = Motion::stationary},
       false,
       3,
       S::no_parallax,
       S::no_parallax,
       false},
      {"coplanar, n=3, two features",
       {.images = 3, .features = 2, .motion = Motion::planar, .layout = Layout::coplanar},
       false,
       2,
       S::coplanar,
       S::coplanar,
       false},
      {"coplanar, n=4, one feature",
       {.images = 4, .features = 1, .motion = Motion::planar, .layout = Layout::coplanar},
       false,
       2,
       S::coplanar,
       S::coplanar,
       false},
      {"coplanar, n=5, one feature",
       {.images = 5, .features = 1, .motion = Motion::planar, .layout = Layout::coplanar},
       false,
       1,
       S::coplanar,
       S::coplanar},
      {"coplanar, n=3, three features",
       {.images = 3, .features = 3, .motion = Motion::planar, .layout = Layout::coplanar},
       false,
       1,
       S::ambiguous,
       S::ok},
      {"coplanar, n=4", {.images = 4, .features = 2, .motion = Motion::planar, .layout = Layout::coplanar}, false, 0},
      {"coplanar, n=6, one feature",
       {.images = 6, .features = 1, .motion = Motion::planar, .layout = Layout::coplanar},
       false,
       0},
      {"straight, n=4, one feature",
       {.images = 4, .features = 1, .motion = Motion::straight},
       false,
       2,
       S::coplanar,
       S::coplanar,
       false},
      {"straight, n=5, one feature",
       {.images = 5, .features = 1, .motion = Motion::straight},
       false,
       1,
       S::coplanar,
       S::coplanar},
      {"straight, n=6, one feature", {.images = 6, .features = 1, .motion = Motion::straight}, false, 0},
      {"straight", {.images = 5, .features = 3, .motion = Motion::straight}, false, 0},
      {"planar motion", {.images = 5, .features = 3, .motion = Motion::planar}, false, 0},
      {"planar features", {.images = 5, .features = 5, .layout = Layout::plane}, false, 0},
      {"collinear features", {.images = 5, .features = 5, .layout = Layout::line}, false, 0},
      {"no rotation", {.images = 5, .features = 5, .turn = Turn::none}, false, 0},
      // Constant acceleration with A = 0: γ₂ = -1.
      {"free fall", {.images = 5, .features = 5, .motion = Motion::free_fall}, false, 1},
      {"straight at a feature",
       {.images = 5, .features = 4, .motion = Motion::straight, .layout = Layout::ahead},
       false,
       1},
      {"lever arm", {.images = 6, .features = 8, .camera = Vector3(0.1, -0.2, 0.05)}, false, 0},
      {"bias, n=3, one feature", {.images = 3, .features = 1}, true, 6, S::too_few_images, S::too_few_images, false},
      {"bias, n=3", {.images = 3, .features = 4}, true, 4, S::too_few_images, S::too_few_images, false},
      {"bias, n=4, one feature", {.images = 4, .features = 1}, true, 4, S::too_few_images, S::too_few_images, false},
      {"bias, n=4", {.images = 4, .features = 3}, true, 1, S::ambiguous, S::ok},
      {"bias, n=5, one feature", {.images = 5, .features = 1}, true, 2, S::too_few_images, S::too_few_images, false},
      {"bias, n=5", {.images = 5, .features = 3, .bias = Vector3(0.1, -0.2, 0.15)}, true, 0},
      {"bias, n=6, one feature", {.images = 6, .features = 1}, true, 0},
      {"bias", {.images = 8, .features = 6, .bias = Vector3(0.1, -0.2, 0.15)}, true, 0},
      {"bias, one axis", {.images = 6, .features = 4, .turn = Turn::fixed_axis}, true, 1, S::mirror_gravity, S::ok},
      {"bias, no rotation",
       {.images = 6, .features = 4, .turn = Turn::none},
       true,
       3,
       S::bias_unobservable,
       S::bias_unobservable},
      {"bias, constant acceleration",
       {.images = 6, .features = 4, .motion = Motion::constant_acceleration},
       true,
       1,
       S::ambiguous,
       S::ok},
      {"bias, constant velocity",
       {.images = 6, .features = 4, .motion = Motion::constant_velocity},
       true,
       1,
       S::scale_unobservable,
       S::scale_unobservable,
       false},
  };
  return list;
}

/// A case that a window with noise can decide: a pixel of 1/450 rad and the noise of an ADIS16448.
struct NoisyClosedFormCase {
  const char* name;  ///< its own
  InertialSceneOptions scene;
  std::vector<FusionStatus> expected;
  double share = 0.97;  ///< at least this fraction of the windows must end with one of these
  bool bias = false;    ///< the bias of the accelerometer is an unknown too
  double bias_sigma = 0.1;
};

/// All of them. Windows have the images that decide; where the case itself is one of few images, those.
inline const std::vector<NoisyClosedFormCase>& noisyClosedFormCases() {
  using S = FusionStatus;
  using Motion = SceneMotion;
  using Turn = SceneTurn;
  using Layout = SceneLayout;
  const double infinite = std::numeric_limits<double>::infinity();
  static const std::vector<NoisyClosedFormCase> list{
      {"general", {.images = 21, .features = 20}, {S::ok}},
      {"general, one second", {.images = 11, .features = 20, .window = 1}, {S::ok}},
      {"general, five images", {.images = 5, .features = 20}, {S::ok}},
      {"no rotation", {.images = 21, .features = 20, .turn = Turn::none}, {S::ok}},
      {"free fall", {.images = 21, .features = 20, .motion = Motion::free_fall}, {S::ok}},
      {"straight at a feature",
       {.images = 21, .features = 20, .motion = Motion::straight, .layout = Layout::ahead},
       {S::ok}},
      {"two images", {.images = 2, .features = 20}, {S::too_few_images}, 1},
      {"three images, one feature", {.images = 3, .features = 1}, {S::too_few_images}, 1},
      {"three images", {.images = 3, .features = 20}, {S::ok, S::ambiguous, S::double_root}, 0.9},
      {"constant acceleration",
       {.images = 21, .features = 20, .motion = Motion::constant_acceleration},
       {S::ok, S::ambiguous, S::double_root}},
      {"level acceleration",
       {.images = 21, .features = 20, .motion = Motion::constant_acceleration, .level_acceleration = true},
       {S::double_root, S::ambiguous},
       0.9},
      {"constant velocity",
       {.images = 21, .features = 20, .motion = Motion::constant_velocity},
       {S::scale_unobservable}},
      {"constant velocity, one second",
       {.images = 11, .features = 20, .motion = Motion::constant_velocity, .window = 1},
       {S::scale_unobservable}},
      {"constant velocity, four seconds",
       {.images = 41, .features = 20, .motion = Motion::constant_velocity, .window = 4},
       {S::scale_unobservable}},
      {"constant velocity, one feature",
       {.images = 21, .features = 1, .motion = Motion::constant_velocity},
       {S::gravity_undetermined, S::no_parallax, S::stationary}},
      {"at rest", {.images = 21, .features = 20, .motion = Motion::stationary}, {S::stationary}},
      {"features 1e3 times farther", {.images = 21, .features = 20, .far = 1e3}, {S::no_parallax}},
      {"features 1e6 times farther", {.images = 21, .features = 20, .far = 1e6}, {S::no_parallax}},
      {"coplanar, one feature",
       {.images = 5, .features = 1, .motion = Motion::planar, .layout = Layout::coplanar},
       {S::coplanar},
       0.9},
      {"bias", {.images = 21, .features = 20}, {S::ok}, 0.97, true},
      {"bias, one axis", {.images = 21, .features = 20, .turn = Turn::fixed_axis}, {S::ok}, 0.9, true},
      {"bias, one axis, no prior",
       {.images = 21, .features = 20, .turn = Turn::fixed_axis},
       {S::mirror_gravity, S::gravity_undetermined},
       0.97,
       true,
       infinite},
      {"bias, no rotation", {.images = 21, .features = 20, .turn = Turn::none}, {S::bias_unobservable}, 0.97, true},
      {"bias, constant velocity",
       {.images = 21, .features = 20, .motion = Motion::constant_velocity},
       {S::scale_unobservable},
       0.9,
       true},
  };
  return list;
}

}  // namespace liestat::experiments
