// What an inertial sensor measures of a scene, under the names that the tests have for it.
#pragma once

#include <experiments/scene_readings.hpp>
#include <support/vi_scene.hpp>

namespace liestat_test {

using liestat::measure;
using liestat::motionsOf;
using liestat::readingsOf;

}  // namespace liestat_test
