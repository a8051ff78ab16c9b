// CrystalOrientation: the orientation of a crystal, a rotation of R^3 modulo the rotations of the crystal's point
// group.
//
// Storage        a rotation R, which takes coordinates along the crystal's axes to those of the sample
//                (lie/point_group.hpp says which axes), and the group G
// Equality       R and R k are the same orientation for every k of G: the symmetry is on the crystal's side. Bunge's
//                matrix g, of his Euler angles, takes the sample's coordinates to the crystal's: R = gᵀ (fromBunge)
// Tangent        rotation vector, rad, along the crystal's axes as R stores them: R·Exp(v)
// Action         of SO3 from the left: rotations of the sample
// Origin         the identity, of the trivial group; points reached from x have the group of x
// Metric         the angle of the least rotation of Rᵀ S k over G (the disorientation angle); curvature 1/4,
//                injectivity radius half of the group's least angle
// Bad input      NaN in, NaN out. Features of one call have one group
// Source         Morawiec 2004, Orientations and Rotations; the quotient as that of frames (Pennec 1998, section 5)
#pragma once

#include <lie/detail/quotient_frame3.hpp>
#include <lie/euler.hpp>
#include <lie/point_group.hpp>
#include <lie/so3.hpp>

#include <algorithm>
#include <cmath>
#include <span>

namespace liestat {

/// The orientation of a crystal; see the header comment.
class CrystalOrientation {
 public:
  using Scalar = double;
  using Params = Eigen::Vector4d;

  CrystalOrientation() = default;
  CrystalOrientation(const SO3d& crystal_to_sample, PointGroup group) : rotation_(crystal_to_sample), group_(group) {}
  /// From Bunge's angles φ1, Φ, φ2 (rad): z x z rotations of the sample's axes to the crystal's.
  static CrystalOrientation fromBunge(double phi1, double capital_phi, double phi2, PointGroup group) {
    return {fromEuler<double>(EulerAxes::zxz, {phi1, capital_phi, phi2}), group};
  }
  /// The rotation of a quaternion, modulo the trivial group.
  static CrystalOrientation fromParams(const Params& q) { return {SO3d::fromParams(q), {}}; }

  const SO3d& rotation() const { return rotation_; }
  PointGroup group() const { return group_; }
  /// The quaternion of rotation().
  const Params& params() const { return rotation_.params(); }
  /// Bunge's angles φ1, Φ, φ2 of rotation(), rad.
  Eigen::Vector3d bunge() const { return toEuler(EulerAxes::zxz, rotation_); }
  /// The rotation of this orientation that is nearest to a rotation: the disorientation from it is the least.
  SO3d nearestTo(const SO3d& other) const;

 private:
  SO3d rotation_;
  PointGroup group_;
};

template <>
struct ManifoldTraits<CrystalOrientation> : TrivialIsotropy<CrystalOrientation, SO3d> {
  using M = CrystalOrientation;
  using Rotation = ManifoldTraits<SO3d>;
  using Choice = RepresentativeChoice<double>;

  static M act(const SO3d& f, const M& x) { return {f * x.rotation(), x.group()}; }
  static SO3d placement(const M& x) { return x.rotation(); }
  static M expOrigin(const Tangent& v) { return {SO3d::exp(v), {}}; }
  /// exp from any point: it keeps the group.
  static M exp(const M& x, const Tangent& v) { return {x.rotation() * SO3d::exp(v), x.group()}; }
  static Square dexpOrigin(const Tangent& v) { return Rotation::dexpOrigin(v); }
  static Tangent logOrigin(const M& x) { return representative(x, nearestIndex(x)).rotation().log(); }
  static Square dlogOrigin(const M& x) {
    const int index = nearestIndex(x);
    return Rotation::dlogOrigin(representative(x, index).rotation()) * representativeJacobian(index);
  }

  /// The copy of x that is nearest to the origin; ties go to the first.
  static Choice nearestRepresentative(const M& x) {
    const detail::RotationGroup& group = x.group().rotations();
    const Eigen::Vector4d& q = x.params();
    const auto nearest = group.nearest(q[0], q[1], q[2], q[3]);
    const double norm = q.norm(), pi = static_cast<double>(EIGEN_PI);
    const auto angle = [norm](double c) { return 2 * std::acos(std::min(std::abs(c) / norm, 1.0)); };
    const Eigen::Vector4d copy = representative(x, group.index[nearest.slot]).params();
    const double best = 2 * std::atan2(copy.head<3>().norm(), std::abs(copy[3]));
    return {group.index[nearest.slot], best, nearest.second < 0 ? 2 * pi - best : angle(nearest.second)};
  }
  /// The index of that copy.
  static int nearestIndex(const M& x) {
    const detail::RotationGroup& group = x.group().rotations();
    const Eigen::Vector4d& q = x.params();
    return group.index[group.nearest(q[0], q[1], q[2], q[3]).slot];
  }
  /// The copy of x by the rotation of an index (lie/point_group.hpp): R k.
  static M representative(const M& x, int index) {
    if (index == 0) return x;
    const auto& k = detail::crystal_rotations[static_cast<std::size_t>(index)];
    return {x.rotation() * SO3d::fromParams({k[0], k[1], k[2], k[3]}), x.group()};
  }
  /// kᵀ, which takes tangent vectors at x to those at the copy.
  static Square representativeJacobian(int index) {
    const auto& k = detail::crystal_rotations[static_cast<std::size_t>(index)];
    return SO3d::fromParams({k[0], k[1], k[2], k[3]}).matrix().transpose();
  }
  /// The indices of x's copies.
  static std::span<const int> representativesOf(const M& x) {
    const detail::RotationGroup& group = x.group().rotations();
    return {group.index.data(), static_cast<std::size_t>(group.order)};
  }

  static Tangent metricWeights() { return Tangent::Ones(); }
  static double maxSectionalCurvature() { return 0.25; }
  /// That of the orientations of x's group; without x the least of all groups.
  static double injectivityRadius(const M& x) { return 0.5 * x.group().leastAngle(); }
  static double injectivityRadius() { return static_cast<double>(EIGEN_PI) / 6; }
  static Square hessianHalfSquaredDistance(const Tangent& z) { return Rotation::hessianHalfSquaredDistance(z); }

  static constexpr CompactFactor compact_factor = CompactFactor::rotation;
  static constexpr int compact_begin = 0;
  static Eigen::Vector4d compactCoordinates(const M& x) { return x.params(); }
  static constexpr TangentBlock tangent_parts[] = {{TangentPart::rotation, 0, 3}};
};

inline SO3d CrystalOrientation::nearestTo(const SO3d& other) const {
  using T = ManifoldTraits<CrystalOrientation>;
  return T::representative(*this, T::nearestIndex(T::act(other.inverse(), *this))).rotation();
}

}  // namespace liestat
