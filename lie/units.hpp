// The unit of angles that people read. The library itself computes in radians and metres throughout.
//
//   using liestat::units::degree;
//   const auto R = liestat::SO3d::rotZ(30 * degree);
//   const double yaw = R.log().z() / degree;  // 30
#pragma once

#include <numbers>

namespace liestat::units {

/// One degree in radians. 30 * degree is an angle, angle / degree its number of degrees.
inline constexpr double degree = std::numbers::pi / 180;

}  // namespace liestat::units
