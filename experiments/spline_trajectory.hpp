#pragma once

#include <lie/se3.hpp>
#include <lie/so3.hpp>

#include <Eigen/Core>
#include <vector>

namespace liestat::experiments {

/// How a body moves at an instant.
struct Kinematics {
  SO3d world_R_body;
  Eigen::Vector3d position, velocity, acceleration;  ///< in the world, m, m/s, m/s²
  Eigen::Vector3d angular_rate;                      ///< in the body's axes, rad/s
};

/// A smooth motion near given poses: uniform B-splines of degree five, on positions as usual and on rotations in their
/// cumulative form. Four times continuously differentiable, so that rates and forces are smooth and exact. The poses
/// are control points: the motion passes near them, not through them.
///
/// Source: C. Sommer, V. Usenko, D. Schubert, N. Demmel, D. Cremers, "Efficient derivative computation for cumulative
/// B-splines on Lie groups", CVPR 2020, equations 22, 28 and 38.
class SplineTrajectory {
 public:
  static constexpr int degree = 5;

  /// Poses at `first`, first + spacing, ... (s). Six at least.
  SplineTrajectory(double first, double spacing, std::vector<SE3d> world_T_body);

  /// Where the motion begins and ends: two spacings within the poses.
  double begin() const { return first_ + 2 * spacing_; }
  double end() const { return first_ + (static_cast<double>(poses_.size()) - 3) * spacing_; }

  /// At a time within begin() and end(), both included; beyond, the outermost piece is continued.
  Kinematics at(double time) const;

 private:
  double first_, spacing_;
  std::vector<SE3d> poses_;
};

}  // namespace liestat::experiments
