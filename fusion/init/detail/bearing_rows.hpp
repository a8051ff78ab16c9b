// The common parts of the least squares over bearings (the gyroscope's bias, the refinement): observations of features,
// their residuals, priors, gravity of known length, and the step of the unknowns that both have.
#pragma once

#include <fusion/init/detail/closed_form_blocks.hpp>
#include <fusion/init/detail/reduced_system.hpp>
#include <fusion/imu/window.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <optional>
#include <vector>

namespace liestat::detail {

/// A feature as one image saw it.
struct BearingObservation {
  std::size_t feature, image;
  Eigen::Vector3d bearing;             ///< in the body
  Eigen::Matrix<double, 2, 3> across;  ///< an orthonormal basis across it
  Eigen::Vector3d lever;               ///< the camera's centre in the body (m)
  double relative_sigma;

  BearingObservation(const InertialWindow& window, const TrackedBearing& seen, std::size_t of_feature)
      : feature(of_feature),
        image(seen.image),
        bearing(bearingInBody(window.cameras, seen)),
        across(tangentRows(bearing)),
        lever(window.cameras[seen.camera].translation()),
        relative_sigma(seen.relative_sigma) {}
};

/// A bearing's residual, across the measured direction in units of σ, of a feature at d from the camera, in the body's
/// axes; with its 2×3 derivative by d. False where the feature is not in front.
inline bool bearingResidual(const Eigen::Vector3d& d, const BearingObservation& seen, double bearing_noise,
                            ResidualRows& rows, Eigen::Matrix<double, 2, 3>& by_d) {
  const double sigma = seen.relative_sigma * bearing_noise, depth = d.norm();
  if (!(seen.bearing.dot(d) > 0)) return false;
  const Eigen::Vector3d e = d / depth;
  const Eigen::Vector2d r = seen.across * e;
  rows.value[0] = r[0] / sigma;
  rows.value[1] = r[1] / sigma;
  by_d = (seen.across - r * e.transpose()) / (sigma * depth);
  return true;
}

/// The cost of an error of one block under a prior, which is added to the system if there is one.
inline double addPrior(const Eigen::Vector3d& error, double sigma, int block, ReducedSystem* system) {
  ResidualRows rows(3);
  rows.add(block, Eigen::Matrix3d(Eigen::Matrix3d::Identity() / sigma));
  for (int k = 0; k < 3; ++k) rows.value[static_cast<std::size_t>(k)] = error[k] / sigma;
  if (system) system->add(rows);
  return rows.squared();
}

/// Takes its freedom from the length of gravity by a stiff row along it, without a cost.
inline void holdLength(const Eigen::Vector3d& gravity, int block, ReducedSystem& system) {
  ResidualRows rows(1);
  rows.value[0] = 0;
  rows.add(block, Eigen::Matrix<double, 1, 3>(1e6 * gravity.normalized().transpose()));
  system.add(rows);
}

/// Takes the system's step of gravity, which keeps its length where that is known, and of the features' positions.
inline void takeStep(const ReducedSystem& system, int gravity_block, const std::optional<double>& length,
                     Eigen::Vector3d& gravity, std::vector<Eigen::Vector3d>& positions) {
  gravity += system.shared(gravity_block);
  if (length) gravity *= *length / gravity.norm();
  for (std::size_t i = 0; i < positions.size(); ++i) positions[i] += system.feature(i);
}

}  // namespace liestat::detail
