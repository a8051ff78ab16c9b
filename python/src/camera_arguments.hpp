// A camera's numbers from Python: fu, fv, cu, cv, the number of the distortion, its four coefficients, width, height,
// the mirror.
#pragma once

#include <fusion/camera.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>

#include <optional>

namespace liestat::python {

inline Camera cameraOf(const double* p) {
  Camera camera{p[0], p[1], p[2], p[3]};
  camera.distortion = static_cast<Distortion>(static_cast<int>(p[4]));
  camera.coefficients = vector<4>(p + 5);
  camera.width = static_cast<int>(p[9]);
  camera.height = static_cast<int>(p[10]);
  camera.mirror = p[11];
  return camera;
}
/// None for an empty array.
inline std::optional<Camera> optionalCamera(const DoubleArray& numbers) {
  if (numbers.size() == 0) return std::nullopt;
  return cameraOf(numbers.data());
}

}  // namespace liestat::python
