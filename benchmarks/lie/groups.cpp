// The operations of the groups, beside what one would write with Eigen alone.
#include "suite.hpp"

#include <lie/se2.hpp>
#include <lie/se3.hpp>

#include <Eigen/Geometry>

namespace liestat::bench {
namespace {

/// Eigen's quaternions and isometries; exp and log through AngleAxis, as its users write them.
void eigenSuite() {
  using Eigen::AngleAxisd, Eigen::Isometry3d, Eigen::Quaterniond, Eigen::Vector3d;
  Inputs random;
  const auto vectors = draw([&] { return random.tangent<3>(); });
  const auto rotations = draw([&] { return Quaterniond(SO3d::exp(random.tangent<3>()).unit_quaternion()); });
  const auto pairs = draw([&] {
    return std::pair(Quaterniond(SO3d::exp(random.tangent<3>()).unit_quaternion()),
                     Quaterniond(SO3d::exp(random.tangent<3>()).unit_quaternion()));
  });
  const auto points = draw([&] {
    return std::pair(Quaterniond(SO3d::exp(random.tangent<3>()).unit_quaternion()), Vector3d(random.normal<3>()));
  });
  const auto poses = draw([&] {
    const auto pose = [&] { return Isometry3d(SE3d::exp(random.tangent<6>()).matrix()); };
    return std::pair(pose(), pose());
  });
  const auto placed = draw(
      [&] { return std::pair(Isometry3d(SE3d::exp(random.tangent<6>()).matrix()), Vector3d(random.normal<3>())); });

  using Points = Eigen::Matrix<double, 3, 100>;
  const auto clouds = draw([&] {
    std::pair<Isometry3d, Points> cloud(SE3d::exp(random.tangent<6>()).matrix(), Points());
    for (int j = 0; j < 100; ++j) cloud.second.col(j) = random.normal<3>();
    return cloud;
  });
  operation("Eigen/isometry_act_on_100", clouds,
            [](const auto& p) { return Points((p.first.linear() * p.second).colwise() + p.first.translation()); });
  operation("Eigen/quaternion_exp", vectors, [](const Vector3d& v) {
    const double angle = v.norm();
    return angle > 0 ? Quaterniond(AngleAxisd(angle, v / angle)) : Quaterniond::Identity();
  });
  operation("Eigen/quaternion_log", rotations, [](const Quaterniond& q) {
    const AngleAxisd a(q);
    return Vector3d(a.angle() * a.axis());
  });
  operation("Eigen/quaternion_product", pairs, [](const auto& p) { return p.first * p.second; });
  operation("Eigen/quaternion_inverse", rotations, [](const Quaterniond& q) { return q.inverse(); });
  operation("Eigen/quaternion_conjugate", rotations, [](const Quaterniond& q) { return Quaterniond(q.conjugate()); });
  operation("Eigen/quaternion_act", points, [](const auto& p) { return Vector3d(p.first * p.second); });
  operation("Eigen/quaternion_matrix", rotations, [](const Quaterniond& q) { return q.toRotationMatrix(); });
  operation("Eigen/isometry_product", poses, [](const auto& p) { return p.first * p.second; });
  operation("Eigen/isometry_inverse", poses, [](const auto& p) { return p.first.inverse(); });
  operation("Eigen/isometry_act", placed, [](const auto& p) { return Vector3d(p.first * p.second); });
}

[[maybe_unused]] const bool registered = [] {
  eigenSuite();
  groupSuite<SO2d>("SO2");
  groupSuite<SO3d>("SO3");
  groupSuite<SE2d>("SE2");
  groupSuite<SE3d>("SE3");
  return true;
}();

}  // namespace
}  // namespace liestat::bench
