#include <support/tf2_peer.hpp>

#include <tf2/LinearMath/Matrix3x3.h>
#include <tf2_geometry_msgs/tf2_geometry_msgs.h>

#include <algorithm>

namespace liestat_test {

std::array<double, 36> tf2TransformCovariance(const std::array<double, 36>& covariance,
                                              const std::array<double, 4>& xyzw) {
  geometry_msgs::PoseWithCovariance::_covariance_type message;
  std::copy(covariance.begin(), covariance.end(), message.begin());
  const tf2::Transform transform(tf2::Quaternion(xyzw[0], xyzw[1], xyzw[2], xyzw[3]), tf2::Vector3(1, 2, 3));
  const auto turned = tf2::transformCovariance(message, transform);
  std::array<double, 36> result{};
  std::copy(turned.begin(), turned.end(), result.begin());
  return result;
}

std::array<double, 3> tf2RollPitchYaw(const std::array<double, 4>& xyzw) {
  std::array<double, 3> angles{};
  tf2::Matrix3x3(tf2::Quaternion(xyzw[0], xyzw[1], xyzw[2], xyzw[3])).getRPY(angles[0], angles[1], angles[2]);
  return angles;
}

}  // namespace liestat_test
