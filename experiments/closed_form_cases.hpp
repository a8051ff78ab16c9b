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
  using Scene = InertialSceneOptions;  // images, features, motion, …
  const auto solved = [](const char* name, const Scene& scene, int null, S status = S::ok, S other = S::ok,
                         bool bias = false) { return ClosedFormCase{name, scene, bias, null, status, other}; };
  const auto unsolved = [](const char* name, const Scene& scene, int null, S status, bool bias = false) {
    return ClosedFormCase{name, scene, bias, null, status, status, false};
  };
  const auto coplanar = [](std::size_t images, std::size_t features) {
    return Scene{images, features, Motion::planar, Turn::general, Layout::coplanar};
  };
  static const std::vector<ClosedFormCase> list{
      unsolved("n=2, one feature", {2, 1}, 5, S::too_few_images),
      unsolved("n=2", {2, 5}, 4, S::too_few_images),
      unsolved("n=3, one feature", {3, 1}, 3, S::too_few_images),
      solved("n=3, two features", {3, 2}, 1, S::ambiguous, S::ok),
      solved("n=3", {3, 6}, 1, S::ambiguous, S::ok),
      solved("n=4, one feature", {4, 1}, 1, S::ambiguous, S::ok),
      solved("n=4", {4, 2}, 0),
      solved("n=5, one feature", {5, 1}, 0),
      solved("general", {6, 8}, 0),
      solved("many", {11, 12}, 0),
      solved("constant acceleration, n=3", {3, 3, Motion::constant_acceleration}, 1, S::ambiguous, S::ok),
      solved("constant acceleration, n=4, one feature", {4, 1, Motion::constant_acceleration}, 1, S::ambiguous, S::ok),
      solved("constant acceleration", {6, 5, Motion::constant_acceleration}, 1, S::ambiguous, S::ok),
      unsolved("constant velocity, n=3", {3, 2, Motion::constant_velocity}, 1, S::scale_unobservable),
      unsolved("constant velocity", {6, 5, Motion::constant_velocity}, 1, S::scale_unobservable),
      unsolved("constant velocity, n=4, one feature", {4, 1, Motion::constant_velocity}, 2, S::gravity_undetermined),
      unsolved("constant velocity, n=7, one feature", {7, 1, Motion::constant_velocity}, 2, S::gravity_undetermined),
      solved("at rest, n=3", {3, 2, Motion::stationary}, 2, S::stationary, S::stationary),
      solved("at rest", {6, 5, Motion::stationary}, 5, S::stationary, S::stationary),
      unsolved("at rest, one feature", {6, 1, Motion::stationary}, 3, S::no_parallax),
      unsolved("coplanar, n=3, two features", coplanar(3, 2), 2, S::coplanar),
      unsolved("coplanar, n=4, one feature", coplanar(4, 1), 2, S::coplanar),
      solved("coplanar, n=5, one feature", coplanar(5, 1), 1, S::coplanar, S::coplanar),
      solved("coplanar, n=3, three features", coplanar(3, 3), 1, S::ambiguous, S::ok),
      solved("coplanar, n=4", coplanar(4, 2), 0),
      solved("coplanar, n=6, one feature", coplanar(6, 1), 0),
      unsolved("straight, n=4, one feature", {4, 1, Motion::straight}, 2, S::coplanar),
      solved("straight, n=5, one feature", {5, 1, Motion::straight}, 1, S::coplanar, S::coplanar),
      solved("straight, n=6, one feature", {6, 1, Motion::straight}, 0),
      solved("straight", {5, 3, Motion::straight}, 0),
      solved("planar motion", {5, 3, Motion::planar}, 0),
      solved("planar features", {.images = 5, .features = 5, .layout = Layout::plane}, 0),
      solved("collinear features", {.images = 5, .features = 5, .layout = Layout::line}, 0),
      solved("no rotation", {.images = 5, .features = 5, .turn = Turn::none}, 0),
      // Constant acceleration with A = 0: γ₂ = -1.
      solved("free fall", {5, 5, Motion::free_fall}, 1),
      solved("straight at a feature", {.images = 5, .features = 4, .motion = Motion::straight, .layout = Layout::ahead},
             1),
      solved("lever arm", {.images = 6, .features = 8, .camera = Vector3(0.1, -0.2, 0.05)}, 0),
      unsolved("bias, n=3, one feature", {3, 1}, 6, S::too_few_images, true),
      unsolved("bias, n=3", {3, 4}, 4, S::too_few_images, true),
      unsolved("bias, n=4, one feature", {4, 1}, 4, S::too_few_images, true),
      solved("bias, n=4", {4, 3}, 1, S::ambiguous, S::ok, true),
      unsolved("bias, n=5, one feature", {5, 1}, 2, S::too_few_images, true),
      solved("bias, n=5", {.images = 5, .features = 3, .bias = Vector3(0.1, -0.2, 0.15)}, 0, S::ok, S::ok, true),
      solved("bias, n=6, one feature", {6, 1}, 0, S::ok, S::ok, true),
      solved("bias", {.images = 8, .features = 6, .bias = Vector3(0.1, -0.2, 0.15)}, 0, S::ok, S::ok, true),
      solved("bias, one axis", {.images = 6, .features = 4, .turn = Turn::fixed_axis}, 1, S::mirror_gravity, S::ok,
             true),
      solved("bias, no rotation", {.images = 6, .features = 4, .turn = Turn::none}, 3, S::bias_unobservable,
             S::bias_unobservable, true),
      solved("bias, constant acceleration", {6, 4, Motion::constant_acceleration}, 1, S::ambiguous, S::ok, true),
      unsolved("bias, constant velocity", {6, 4, Motion::constant_velocity}, 1, S::scale_unobservable, true),
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
      {"general", {21, 20}, {S::ok}},
      {"general, one second", {.images = 11, .features = 20, .window = 1}, {S::ok}},
      {"general, five images", {5, 20}, {S::ok}},
      {"no rotation", {.images = 21, .features = 20, .turn = Turn::none}, {S::ok}},
      {"free fall", {21, 20, Motion::free_fall}, {S::ok}},
      {"straight at a feature",
       {.images = 21, .features = 20, .motion = Motion::straight, .layout = Layout::ahead},
       {S::ok}},
      {"two images", {2, 20}, {S::too_few_images}, 1},
      {"three images, one feature", {3, 1}, {S::too_few_images}, 1},
      {"three images", {3, 20}, {S::ok, S::ambiguous, S::double_root}, 0.9},
      {"constant acceleration", {21, 20, Motion::constant_acceleration}, {S::ok, S::ambiguous, S::double_root}},
      {"level acceleration",
       {.images = 21, .features = 20, .motion = Motion::constant_acceleration, .level_acceleration = true},
       {S::double_root, S::ambiguous},
       0.9},
      {"constant velocity", {21, 20, Motion::constant_velocity}, {S::scale_unobservable}},
      {"constant velocity, one second",
       {.images = 11, .features = 20, .motion = Motion::constant_velocity, .window = 1},
       {S::scale_unobservable}},
      {"constant velocity, four seconds",
       {.images = 41, .features = 20, .motion = Motion::constant_velocity, .window = 4},
       {S::scale_unobservable}},
      {"constant velocity, one feature",
       {21, 1, Motion::constant_velocity},
       {S::gravity_undetermined, S::no_parallax, S::stationary}},
      {"at rest", {21, 20, Motion::stationary}, {S::stationary}},
      {"features 1e3 times farther", {.images = 21, .features = 20, .far = 1e3}, {S::no_parallax}},
      {"features 1e6 times farther", {.images = 21, .features = 20, .far = 1e6}, {S::no_parallax}},
      {"coplanar, one feature",
       {.images = 5, .features = 1, .motion = Motion::planar, .layout = Layout::coplanar},
       {S::coplanar},
       0.9},
      {"bias", {21, 20}, {S::ok}, 0.97, true},
      {"bias, one axis", {.images = 21, .features = 20, .turn = Turn::fixed_axis}, {S::ok}, 0.9, true},
      {"bias, one axis, no prior",
       {.images = 21, .features = 20, .turn = Turn::fixed_axis},
       {S::mirror_gravity, S::gravity_undetermined},
       0.97,
       true,
       infinite},
      {"bias, no rotation", {.images = 21, .features = 20, .turn = Turn::none}, {S::bias_unobservable}, 0.97, true},
      {"bias, constant velocity", {21, 20, Motion::constant_velocity}, {S::scale_unobservable}, 0.9, true},
  };
  return list;
}

}  // namespace liestat::experiments
