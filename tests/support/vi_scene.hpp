// The library's simulated scenes under the names that the tests have for them.
#pragma once

#include <experiments/inertial_scene.hpp>

namespace liestat_test {

using Scene = liestat::experiments::InertialScene;
using liestat::CounterRng;
using SceneOptions = liestat::experiments::InertialSceneOptions;
using liestat::experiments::SceneLayout;
using liestat::experiments::SceneMotion;
using liestat::experiments::SceneTurn;

}  // namespace liestat_test
