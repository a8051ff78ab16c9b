// Quaternions whose numbers are read in the other order.
#pragma once

#include <lie/so3.hpp>

#include <Eigen/Geometry>

namespace liestat::detail {

/// The rotation that the four numbers of the quaternion mean if w comes first.
inline SO3d wFirst(const SO3d& R) {
  const Eigen::Vector4d& q = R.params();  // x y z w as read, that is w x y z of the file
  return SO3d(Eigen::Quaterniond(q[0], q[1], q[2], q[3]));
}

}  // namespace liestat::detail
