// The motion between two images as an edge of a graph of poses: what is open stays open. Needs Eigen alone.
#pragma once

#include <fusion/two_view/two_view_types.hpp>
#include <lie/detail/small_matrix.hpp>
#include <lie/se3.hpp>

#include <Eigen/Core>

#include <limits>
#include <optional>
#include <string>

namespace liestat {

/// A relative pose in units of its own baseline, which images do not tell.
struct TwoViewEdge {
  /// The translation has length one; it is zero where the camera only turned.
  SE3d second_T_first;
  /// Its tangent is (translation, rotation) of second_T_first·Exp(e), axes of the first camera. With a baseline it has
  /// rank five, since the length is one by definition; where the camera only turned its translation is NaN: open.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  /// The inverse where it has one, zero along what images leave open; nothing of `translation`, which states that
  /// there is no rotation at all.
  std::optional<Eigen::Matrix<double, 6, 6>> information = {};
};

/// The edge of an estimate with a pose: of essential, upright, translation and rotation between calibrated cameras.
/// Nothing for other models, for an estimate that is not ok, and for `none`, which has no covariance.
inline std::optional<TwoViewEdge> edgeOf(const TwoViewMotionEstimate& estimate) {
  if (!estimate.ok() || !estimate.calibrated) return std::nullopt;
  TwoViewEdge edge;
  if (estimate.relative_pose) {
    const Essentiald& pose = estimate.relative_pose->mean;
    const Eigen::Matrix3d A = ManifoldTraits<S2d>::placement(pose.direction()).matrix();
    const Eigen::Matrix3d to_first = pose.so3().matrix().transpose() * A;
    Eigen::Matrix<double, 6, 5> J = Eigen::Matrix<double, 6, 5>::Zero();  // orthonormal columns
    J.topLeftCorner<3, 2>() = to_first.leftCols<2>();
    J.bottomRightCorner<3, 3>() = to_first;
    edge.second_T_first = SE3d(pose.so3(), pose.direction().unit_vector());
    edge.covariance = J * estimate.relative_pose->covariance * J.transpose();
    const detail::Cholesky<double, 5> factor(estimate.relative_pose->covariance);
    if (factor.ok()) edge.information = J * factor.inverse() * J.transpose();
    return edge;
  }
  const std::string& model = estimate.chosenModel().name;
  if (estimate.physical.size() != 1 || (model != "translation" && model != "rotation")) return std::nullopt;
  const PhysicalParameters& p = estimate.physical.front();
  if (model == "translation") {
    edge.second_T_first = SE3d(SO3d(), Eigen::Vector3d(p.values));
    edge.covariance.topLeftCorner<3, 3>() = p.covariance;
    return edge;
  }
  edge.second_T_first = SE3d(SO3d::exp(p.values), Eigen::Vector3d::Zero());
  edge.covariance.setConstant(std::numeric_limits<double>::quiet_NaN());
  edge.covariance.bottomRightCorner<3, 3>() = p.covariance;
  const detail::Cholesky<double, 3> factor{Eigen::Matrix3d(p.covariance)};
  if (factor.ok()) {
    edge.information.emplace(Eigen::Matrix<double, 6, 6>::Zero());
    edge.information->bottomRightCorner<3, 3>() = factor.inverse();
  }
  return edge;
}

}  // namespace liestat
