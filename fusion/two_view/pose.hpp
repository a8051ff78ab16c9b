// Poses of two calibrated views from an essential matrix, and from the homography of a plane.
//
// A pose takes points of the first camera's frame to the second's, x' = R x + t; an essential matrix E = [t]× R obeys
// ũ'ᵀ E ũ = 0. It is the relative pose second_T_first, so Essential (lie/essential.hpp) has the second view as a and
// the first as b. A homography H ~ R + t nᵀ/d shows the plane n·x = d > 0 of the first frame.
#pragma once

#include <fusion/two_view/solutions.hpp>
#include <lie/detail/essential_matrix.hpp>
#include <lie/detail/small_orthogonal.hpp>
#include <lie/detail/trig.hpp>
#include <lie/essential.hpp>
#include <lie/so3.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>
#include <utility>

namespace liestat {

/// Focal lengths of two views, in the unit of the coordinates.
struct FocalLengths {
  double first = 1, second = 1;
};

/// x' = R x + t; t of length one where two views leave its length open.
struct TwoViewPose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
};

/// E = [t]× R.
inline Eigen::Matrix3d essentialFromPose(const TwoViewPose& pose) { return detail::skewTimes<double>(pose.t, pose.R); }
/// The pose as a point of the essential manifold; t of any positive length.
inline Essentiald toEssential(const TwoViewPose& pose) { return Essentiald(SO3d::fitToSO3(pose.R), pose.t); }
/// The pose of a point of the essential manifold, |t| = 1.
inline TwoViewPose toPose(const Essentiald& essential) {
  return {essential.so3().matrix(), essential.direction().unit_vector()};
}

/// The four poses of an essential matrix of either sign and any positive norm, in the order of decomposeEssential:
/// (R, t), (R', -t), (R', t), (R, -t), R' being R turned by pi about t; |t| = 1. None of a matrix that is zero or not
/// finite. (B. K. P. Horn, "Recovering baseline and orientation from essential matrix", 1990.)
inline Solutions<TwoViewPose, 4> posesOfEssential(const Eigen::Matrix3d& E) {
  Solutions<TwoViewPose, 4> result;
  const double largest = E.cwiseAbs().maxCoeff();
  if (!(largest > 0) || !E.allFinite()) return result;
  std::array<TwoViewPose, 4> poses;
  const auto essentials = decomposeEssential(Eigen::Matrix3d(E / largest));
  std::transform(essentials.begin(), essentials.end(), poses.begin(), [](const Essentiald& e) { return toPose(e); });
  const auto finite = [](const TwoViewPose& pose) { return pose.R.allFinite() && pose.t.allFinite(); };
  if (!std::all_of(poses.begin(), poses.end(), finite)) return result;
  for (const TwoViewPose& pose : poses) result.add(pose);
  return result;
}

/// Where the point of a match lies for a pose: 1 in front of both views, -1 behind both, 0 behind one, or at infinity,
/// its rays parallel to `min_parallax` (the sine of their angle). Depths follow from λ' ũ' = λ R ũ + t.
inline int sideOf(const TwoViewPose& pose, const Eigen::Vector4d& match, double min_parallax = 1e-12) {
  const Eigen::Vector3d v(match[2], match[3], 1), y = pose.R * Eigen::Vector3d(match[0], match[1], 1), n = v.cross(y);
  if (!(n.squaredNorm() > min_parallax * min_parallax * v.squaredNorm() * y.squaredNorm())) return 0;
  const double second = pose.t.cross(y).dot(n), first = pose.t.cross(v).dot(n);
  return (first > 0 && second > 0 ? 1 : 0) - (first < 0 && second < 0 ? 1 : 0);
}

/// The pose of an essential matrix that puts most of the matches in front of both views.
struct CheiralPose {
  TwoViewPose pose;
  std::size_t in_front = 0;             ///< 0 where no pose has any
  std::array<std::size_t, 4> counts{};  ///< matches in front, for each pose in the order of posesOfEssential
};
/// The matches are in coordinates in which the cameras of E have the given focal lengths. Those whose rays are parallel
/// to `min_parallax` count for no pose; the first of equals is chosen. Two of the four poses differ from the others by
/// the sign of t alone: two tests of signs a match.
inline CheiralPose poseByCheirality(const Eigen::Matrix3d& E, std::span<const Eigen::Vector4d> matches,
                                    double min_parallax = 1e-12, const FocalLengths& focal = {}) {
  CheiralPose result;
  const Solutions<TwoViewPose, 4> poses = posesOfEssential(E);
  if (poses.empty()) return result;
  for (const Eigen::Vector4d& match : matches) {
    const Eigen::Vector4d m(match[0] / focal.first, match[1] / focal.first, match[2] / focal.second,
                            match[3] / focal.second);
    const int side = sideOf(poses[0], m, min_parallax), twisted = sideOf(poses[1], m, min_parallax);
    result.counts[0] += side > 0 ? 1U : 0U;
    result.counts[3] += side < 0 ? 1U : 0U;
    result.counts[1] += twisted > 0 ? 1U : 0U;
    result.counts[2] += twisted < 0 ? 1U : 0U;
  }
  std::size_t best = 0;
  for (std::size_t i = 1; i < 4; ++i) {
    if (result.counts[i] > result.counts[best]) best = i;
  }
  result.pose = poses[best];
  result.in_front = result.counts[best];
  return result;
}

/// A pose from the homography of a plane, H ~ R + t nᵀ: lengths in units of the plane's distance from the first camera.
struct PlanePose {
  TwoViewPose pose;
  Eigen::Vector3d n = Eigen::Vector3d::UnitZ();  ///< normal of the plane n·x = 1, away from the first camera
  std::size_t in_front = 0;                      ///< matches whose point of the plane lies in front of both views
};
/// The poses that a homography and the matches on the plane may mean, those with more matches in front first: two, or
/// one where t is along n, or where H is a rotation to 1e-12 (t zero, and n says nothing). Where no matches are given,
/// n.z ≥ 0. None where H is singular to 1e-12, or not finite. (Y. Ma, S. Soatto, J. Kosecka, S. Sastry, "An Invitation
/// to 3-D Vision", 2004, section 5.3.)
inline Solutions<PlanePose, 2> posesOfHomography(const Eigen::Matrix3d& homography,
                                                 std::span<const Eigen::Vector4d> matches = {}) {
  Solutions<PlanePose, 2> result;
  if (!homography.allFinite()) return result;
  const detail::SmallSvd svd(detail::SmallMatrix::of<3, 3>(homography));
  const double middle = svd.value(1);
  if (!(svd.value(2) > 1e-12 * svd.value(0))) return result;
  const Eigen::Matrix3d H = homography * ((homography.determinant() < 0 ? -1 : 1) / middle);
  const auto row = [](const detail::SmallMatrix& m, int i) { return Eigen::Vector3d(m(i, 0), m(i, 1), m(i, 2)); };
  const Eigen::Vector3d v1 = row(svd.v, 0), v2 = row(svd.v, 1), v3 = row(svd.v, 2);
  const double s1 = svd.value(0) / middle, s3 = svd.value(2) / middle;
  const auto count = [&](PlanePose& plane) {
    std::size_t front = 0, behind = 0;
    for (const Eigen::Vector4d& m : matches) {
      const Eigen::Vector3d u(m[0], m[1], 1);
      const bool second = H.row(2).dot(u) > 0;
      front += plane.n.dot(u) > 0 && second ? 1U : 0U;
      behind += plane.n.dot(u) < 0 && second ? 1U : 0U;
    }
    if (behind > front || (matches.empty() && plane.n.z() < 0)) {
      plane.n = -plane.n;
      plane.pose.t = -plane.pose.t;
      std::swap(front, behind);
    }
    plane.in_front = front;
  };
  // 1 - s₃ and s₁ - 1 without cancellation.
  const double below = (middle - svd.value(2)) / middle * (1 + s3), above = (svd.value(0) - middle) / middle * (1 + s1);
  if (!(below + above > 2e-12)) {
    PlanePose plane;
    plane.pose.R = SO3d::fitToSO3(H).matrix();
    count(plane);
    result.add(plane);
    return result;
  }
  // Vectors in the plane through v₂ whose lengths H keeps: it is the plane that both views share.
  double a = std::sqrt(below / (below + above)), b = std::sqrt(above / (below + above));
  const bool one = std::min(a, b) < 1e-7;
  if (one) (a < b ? a : b) = 0;
  PlanePose planes[2];
  for (int i = 0; i < (one ? 1 : 2); ++i) {
    const Eigen::Vector3d u = a * v1 + (i == 0 ? b : -b) * v3, n = v2.cross(u);
    const Eigen::Vector3d w2 = (H * v2).normalized(), w = w2.cross(H * u).normalized();
    Eigen::Matrix3d U, W;
    U << v2, n.cross(v2), n;
    W << w2, w.cross(w2), w;
    planes[i].pose.R = W * U.transpose();
    planes[i].n = n;
    planes[i].pose.t = (H - planes[i].pose.R) * n;
    count(planes[i]);
  }
  const int first = !one && planes[1].in_front > planes[0].in_front ? 1 : 0;
  result.add(planes[first]);
  if (!one) result.add(planes[1 - first]);
  return result;
}

}  // namespace liestat
