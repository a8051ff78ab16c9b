#pragma once

#include <fusion/camera.hpp>

#include <vector>

namespace liestat::cli {

/// A pinhole camera of fu, fv, cu, cv, as --intrinsics gives them. Throws OptionError unless these are four finite
/// numbers, the first two of them positive.
Camera cameraFromIntrinsics(const std::vector<double>& intrinsics);

}  // namespace liestat::cli
