// Losses of a covariance when it is converted from one convention to another: digits far from the origin and near the
// pole of Euler angles, and what is not linear. docs/theory/conventions.md, section 5.
#pragma once

#include <lie/linear.hpp>
#include <stats/conventions.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace liestat {

/// Errors that are linear functions of each other at a given pose, whatever their size: between perturbations of one
/// family a conversion is exact. docs/theory/conventions.md, section 3.
enum class PerturbationFamily { screw, frame, euler_angles, rotation_vector };
constexpr PerturbationFamily family(Perturbation perturbation) {
  switch (perturbation) {
    case Perturbation::right:
    case Perturbation::left:
    case Perturbation::transposed_axes:
      return PerturbationFamily::screw;
    case Perturbation::roll_pitch_yaw:
    case Perturbation::yaw_pitch_roll:
      return PerturbationFamily::euler_angles;
    case Perturbation::rotation_vector:
      return PerturbationFamily::rotation_vector;
    default:
      return PerturbationFamily::frame;
  }
}

/// A reason why a converted covariance is not to be used as it is.
enum class ConversionProblem {
  none,
  far_origin,       ///< a perturbation about an origin so far away that the translation's digits cancel
  near_pole,        ///< Euler angles so near pitch ±90° that digits cancel
  undefined_angles  ///< the standard deviation of an Euler angle is so large that the angle means nothing
};
constexpr const char* message(ConversionProblem problem) {
  switch (problem) {
    case ConversionProblem::none:
      return "nothing is lost";
    case ConversionProblem::far_origin:
      return "the origin is so far away that a perturbation of the world cancels the digits of the position: recentre "
             "the poses";
    case ConversionProblem::near_pole:
      return "the pitch is so near to 90 degrees that the digits of roll and yaw cancel: use a convention without "
             "Euler angles";
    case ConversionProblem::undefined_angles:
      return "the standard deviation of an Euler angle would exceed 0.5 rad, and the angle means nothing: use a "
             "convention without Euler angles";
  }
  return "unknown";
}

/// Standard deviations from where on a conversion between families is no longer of first order (rad), and Euler angles
/// mean nothing; and the error of a round trip that is accepted, in units of the standard deviations.
inline constexpr double first_order_sigma = 0.1, largest_angle_sigma = 0.5, largest_round_trip = 1e-6;

/// The losses.
struct ConversionLoss {
  /// Bound of the rounding of there and back, of an entry (i, j) in units of σ_i σ_j of the library's covariance:
  /// 64 eps (1 + |p|² σ_r²/σ_t²) for a perturbation of the world, over cos² pitch for Euler angles.
  double round_trip = 0;
  double rotation_sigma = 0;  ///< largest standard deviation of the rotation about an axis of the body, rad
  double angle_sigma = 0;     ///< largest standard deviation of roll and yaw in the result, rad; 0 if there are none
  bool same_family = true;    ///< the conversion is linear: no loss by large rotations
  ConversionProblem problem = ConversionProblem::none;

  /// True if the conversion's first order is not enough: sample (stats/convention_sampling.hpp).
  bool firstOrderFails() const { return !same_family && rotation_sigma > first_order_sigma; }
};

/// The loss of converting g (in the library's convention) from one convention to another. Unknown entries (NaN) are
/// passed over.
inline ConversionLoss conversionLoss(const Convention& from, const Convention& to, const Gaussian<SE3d>& g) {
  ConversionLoss loss;
  loss.same_family = family(from.perturbation) == family(to.perturbation);
  double smallest_translation = std::numeric_limits<double>::infinity(), largest_rotation = 0;
  for (int i = 0; i < 3; ++i) {
    const double t = g.covariance(i, i), r = g.covariance(i + 3, i + 3);
    if (t > 0) smallest_translation = std::min(smallest_translation, t);
    if (r > 0) largest_rotation = std::max(largest_rotation, r);
  }
  loss.rotation_sigma = std::sqrt(largest_rotation);
  double factor = 1;
  bool world = false;
  if (from.perturbation != to.perturbation &&
      (from.perturbation == Perturbation::left || to.perturbation == Perturbation::left)) {
    world = true;
    if (std::isfinite(smallest_translation)) {
      factor += g.mean.translation().squaredNorm() * largest_rotation / smallest_translation;
    }
  }
  const auto hasAngles = [](const Convention& c) { return family(c.perturbation) == PerturbationFamily::euler_angles; };
  const double cos_pitch = std::cos(toRollPitchYaw(g.mean.so3())[1]);
  if (!loss.same_family && (hasAngles(from) || hasAngles(to))) factor /= cos_pitch * cos_pitch;
  loss.round_trip = 64 * std::numeric_limits<double>::epsilon() * factor;
  if (!loss.same_family && hasAngles(to)) {
    const detail::Matrix6d C = detail::congruenceOfKnown(
        conventionJacobian({.perturbation = Perturbation::roll_pitch_yaw}, g.mean), g.covariance);
    for (const int i : {3, 5}) {
      if (C(i, i) > 0) loss.angle_sigma = std::max(loss.angle_sigma, std::sqrt(C(i, i)));
    }
  }
  if (loss.angle_sigma > largest_angle_sigma) {
    loss.problem = ConversionProblem::undefined_angles;
  } else if (!(loss.round_trip <= largest_round_trip)) {
    loss.problem = world ? ConversionProblem::far_origin : ConversionProblem::near_pole;
  }
  return loss;
}

/// True if the part of a matrix that is known (not NaN) is positive semidefinite up to rounding.
inline bool isSemidefinite(const Eigen::Matrix<double, 6, 6>& matrix) {
  const auto known = [&](int i, int j) { return std::isnan(matrix(i, j)) ? double(i == j) : matrix(i, j); };
  // Free of units, and with room for the rounding of what is singular.
  Eigen::Matrix<double, 6, 6> R;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      const double scale = std::sqrt(known(i, i) * known(j, j));
      R(i, j) = scale > 0 ? known(i, j) / scale : (i == j ? 1 : (known(i, j) == 0 ? 0 : 2));
    }
    R(i, i) += 1e-9;
  }
  return Cholesky<double, 6>(R).ok();
}

/// Sets unknown (NaN) covariances between known components to 0; true if there were any.
inline bool assumeUncorrelated(Eigen::Matrix<double, 6, 6>& matrix) {
  bool any = false;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      if (!std::isnan(matrix(i, j)) || std::isnan(matrix(i, i)) || std::isnan(matrix(j, j))) continue;
      matrix(i, j) = 0;
      any = true;
    }
  }
  return any;
}

}  // namespace liestat
