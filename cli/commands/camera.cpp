#include <cli/commands/camera.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include <formats/input_error.hpp>

namespace liestat::cli {

Camera cameraFromIntrinsics(const std::vector<double>& intrinsics) {
  const bool finite = std::all_of(intrinsics.begin(), intrinsics.end(), [](double x) { return std::isfinite(x); });
  if (intrinsics.size() != 4 || !finite || !(intrinsics[0] > 0) || !(intrinsics[1] > 0)) {
    throw OptionError("--intrinsics", fmt::format("{}", fmt::join(intrinsics, ",")),
                      "fu,fv,cu,cv in pixels, the focal lengths positive");
  }
  Camera camera;
  camera.fu = intrinsics[0], camera.fv = intrinsics[1], camera.cu = intrinsics[2], camera.cv = intrinsics[3];
  return camera;
}

}  // namespace liestat::cli
