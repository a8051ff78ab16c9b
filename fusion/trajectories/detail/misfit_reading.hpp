// Readings of a pose: the faults of whole trajectories without continuous parameters.
#pragma once

#include <Eigen/Core>
#include <fusion/trajectories/detail/quaternion_order.hpp>
#include <fusion/trajectory_misfit_types.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/se3.hpp>

#include <algorithm>
#include <array>
#include <vector>

namespace liestat::detail {

/// The 48 signed permutations; the identity first, then the other proper ones.
inline std::vector<Eigen::Matrix3d> signedPermutations() {
  std::vector<Eigen::Matrix3d> all;
  for (const double proper : {1., -1.}) {
    std::array<int, 3> order{0, 1, 2};
    do {
      for (int signs = 0; signs < 8; ++signs) {
        Eigen::Matrix3d P = Eigen::Matrix3d::Zero();
        for (int i = 0; i < 3; ++i) P(i, order[static_cast<std::size_t>(i)]) = signs >> i & 1 ? -1 : 1;
        if (determinantOf<double>(P) * proper > 0) all.push_back(P);
      }
    } while (std::next_permutation(order.begin(), order.end()));
  }
  return all;
}

/// Its inverse: the rotation that a reader of w first takes for another.
inline SO3d wLast(const SO3d& R) {
  const Eigen::Vector4d& q = R.params();
  return SO3d(Eigen::Quaterniond(q[2], q[3], q[0], q[1]));
}

/// How the numbers of a pose are read: the faults without continuous parameters. A reference whose quaternions have w
/// first is left as it is, and the estimate's are misread alike.
struct MisfitReading {
  bool w_first = false, reference_w_first = false, rotation_inverse = false, position_inverse = false;
  bool local_noise = false;  // of inverted poses: in the axes of the pose as it is written
  Eigen::Matrix3d A = Eigen::Matrix3d::Identity(), B = A, C = A;  // rotations A R B, positions C p

  SE3d operator()(const SE3d& pose) const {
    SO3d R = w_first ? wFirst(pose.so3()) : reference_w_first ? wLast(pose.so3()) : SO3d(pose.so3());
    Eigen::Vector3d p = pose.translation();
    if (position_inverse) p = -(R.inverse() * p);
    if (rotation_inverse) R = R.inverse();
    if (!A.isIdentity(0) || !B.isIdentity(0)) R = SO3d::fitToSO3(A * R.matrix() * B);
    return SE3d(R, Eigen::Vector3d(C * p));
  }
  std::vector<Misfit> faults() const {
    std::vector<Misfit> list;
    if (w_first) list.push_back(Misfit::w_first);
    if (reference_w_first) list.push_back(Misfit::reference_w_first);
    if (rotation_inverse || position_inverse) {
      list.push_back(!position_inverse   ? Misfit::rotation_inverse
                     : !rotation_inverse ? Misfit::position_inverse
                                         : Misfit::inverse);
    }
    const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
    const bool conjugate = B == A.transpose(), proper = determinantOf<double>(C) > 0;
    const bool alike = C == (proper ? A : Eigen::Matrix3d(-A));  // positions follow the world's axes
    if (!proper) list.push_back(alike ? Misfit::mirrored : Misfit::mirrored_positions);
    if (alike && proper && A != I) list.push_back(conjugate ? Misfit::axes : Misfit::world_axes);
    if (!alike && proper && C != I) list.push_back(Misfit::position_axes);
    if (!alike && A != I) list.push_back(Misfit::rotation_axes);
    if (B != I && !conjugate) list.push_back(Misfit::body_axes);
    return list;
  }
};

}  // namespace liestat::detail
