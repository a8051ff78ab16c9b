// tf2's functions behind plain arrays, for ROS 1's messages do not compile as C++20.
#pragma once

#include <array>

namespace liestat_test {

/// tf2::transformCovariance of 36 numbers by a rotation (x y z w).
std::array<double, 36> tf2TransformCovariance(const std::array<double, 36>& covariance,
                                              const std::array<double, 4>& xyzw);
/// Roll, pitch and yaw of a rotation by tf2::Matrix3x3::getRPY.
std::array<double, 3> tf2RollPitchYaw(const std::array<double, 4>& xyzw);

}  // namespace liestat_test
