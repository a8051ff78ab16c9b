// The library's simulated scenes under the names that the tests have for them.
#pragma once

#include <experiments/inertial_scene.hpp>

namespace liestat_test {

using Scene = liestat::InertialScene;
using SceneOptions = liestat::InertialSceneOptions;
using liestat::SceneLayout;
using liestat::SceneMotion;
using liestat::SceneRandom;
using liestat::SceneTurn;

}  // namespace liestat_test
