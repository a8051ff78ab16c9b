// The physical form of a fundamental matrix of two cameras of unknown focal lengths: F ~ K'⁻ᵀ [t]× R K⁻¹, K = diag(f, f,
// 1) and K' = diag(f', f', 1), coordinates from the principal points.
#pragma once

#include <fusion/two_view/epipolar_solvers.hpp>
#include <fusion/two_view/pose.hpp>
#include <lie/detail/trig.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <cmath>
#include <limits>
#include <optional>
#include <span>

namespace liestat {

/// A motion between two cameras of unknown focal lengths, seven parameters.
struct PhysicalMotion {
  FocalLengths focal;
  TwoViewPose pose;  ///< |t| = 1
};

/// F = K'⁻ᵀ [t]× R K⁻¹, ‖F‖² = 2.
inline Eigen::Matrix3d fundamentalFromMotion(const PhysicalMotion& motion) {
  const Eigen::Vector3d k(1 / motion.focal.first, 1 / motion.focal.first, 1),
      k2(1 / motion.focal.second, 1 / motion.focal.second, 1);
  const Eigen::Matrix3d F = k2.asDiagonal() * essentialFromPose(motion.pose) * k.asDiagonal();
  return F * std::sqrt(2 / F.squaredNorm());
}

namespace detail {

/// f² of the first view: with p = (0, 0, 1), e' the left epipole, g = p × e' and Ĩ = diag(1, 1, 0),
/// f² = -(gᵀ F p)(pᵀ Fᵀ p) / (gᵀ F Ĩ Fᵀ p). NaN where a factor is below the tolerance times its size.
inline double squaredFocalLength(const Eigen::Matrix3d& F, double tolerance) {
  const Eigen::Vector3d e = rightNullVector(F.transpose());
  const Eigen::Vector2d g(-e.y(), e.x());
  const Eigen::Vector2d left = F.topLeftCorner<2, 2>().transpose() * g, right = F.block<1, 2>(2, 0);
  const Eigen::Vector2d column = F.block<2, 1>(0, 2);
  const double a = g.dot(column), b = F(2, 2), c = left.dot(right);
  const bool told = std::abs(a) > tolerance * g.norm() * column.norm() && std::abs(b) > tolerance * F.norm() &&
                    std::abs(c) > tolerance * left.norm() * right.norm() && g.norm() > tolerance * e.norm();
  return told ? -a * b / c : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace detail

/// Both focal lengths from a fundamental matrix of coordinates about the principal points (S. Bougnoux, "From projective
/// to Euclidean space under any practical situation, a criticism of self-calibration", ICCV 1998; derived here from
/// Kruppa's equations). Nothing where they are not determined, a factor of the formula being below the tolerance times
/// its size: the optical axes meet (F33 = 0; parallel axes meet at infinity), or the baseline and one optical axis span
/// a plane at a right angle to the plane of the baseline and the other; nothing either where a square comes out
/// negative. Near such motions noise decides. Coordinates should be of the order of one, u = (p - c)/f with any guess
/// of f.
inline std::optional<FocalLengths> focalLengths(const Eigen::Matrix3d& F, double tolerance = 1e-9) {
  const double first = detail::squaredFocalLength(F, tolerance),
               second = detail::squaredFocalLength(F.transpose(), tolerance);
  if (!(first > 0 && second > 0) || !std::isfinite(first + second)) return std::nullopt;
  return FocalLengths{std::sqrt(first), std::sqrt(second)};
}

/// The physical form of a fundamental matrix: focal lengths, and of the four poses that with most matches in front of
/// both views. Nothing where focal lengths are not determined, or no match lies in front.
inline std::optional<PhysicalMotion> motionFromFundamental(const Eigen::Matrix3d& F,
                                                           std::span<const Eigen::Vector4d> matches,
                                                           double tolerance = 1e-9) {
  const std::optional<FocalLengths> focal = focalLengths(F, tolerance);
  if (!focal) return std::nullopt;
  const Eigen::Vector3d k(focal->first, focal->first, 1), k2(focal->second, focal->second, 1);
  const Eigen::Matrix3d E = k2.asDiagonal() * F * k.asDiagonal();
  const CheiralPose chosen = poseByCheirality(E, matches, 1e-12, *focal);
  if (chosen.in_front == 0) return std::nullopt;
  return PhysicalMotion{*focal, chosen.pose};
}

}  // namespace liestat
