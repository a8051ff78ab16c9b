// Messages of ROS as they are serialised: ROS 1's packed little-endian bytes, and CDR of either byte order.
#pragma once

#include <formats/bag.hpp>

#include <Eigen/Core>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace liestat::detail {

/// The types that are read.
enum class BagType { pose, pose_with_covariance, odometry, transform, transforms, path, imu };
/// The type of that name; nothing if it is not read.
std::optional<BagType> bagTypeOf(std::string_view name);

/// A pose with its header. Of a transform `frame_T_child`.
struct BagPose {
  std::int64_t stamp_ns = 0;
  std::string frame, child;
  Eigen::Vector3d position;
  Eigen::Vector4d xyzw;
  std::vector<double> covariance;  ///< 36 numbers row by row, or none
};

/// sensor_msgs/Imu: rad/s and m/s², and the covariances of each, row by row.
struct BagImu {
  std::int64_t stamp_ns = 0;
  Eigen::Vector3d rate, force;
  Eigen::Matrix<double, 9, 1> rate_covariance, force_covariance;
};

/// The pose of a message, the transforms of a TFMessage or the poses of a Path, each with its own stamp. Throws
/// InputError with the file and the message's number where the bytes are not those of the type.
std::vector<BagPose> posesOf(const BagTopic& topic, std::string_view data, const std::string& file, std::size_t number);
/// The same of an Imu message.
BagImu imuOf(const BagTopic& topic, std::string_view data, const std::string& file, std::size_t number);

}  // namespace liestat::detail
