// Inertial measurements of a scene, under the names that the tests have for them.
#pragma once

#include <experiments/scene_readings.hpp>
#include <support/vi_scene.hpp>

namespace liestat_test {

using liestat::experiments::measure;
using liestat::experiments::motionsOf;
using liestat::experiments::readingsOf;
using liestat::experiments::windowOf;

}  // namespace liestat_test
