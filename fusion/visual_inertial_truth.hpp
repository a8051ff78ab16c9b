// Errors of a visual-inertial initialisation against a ground truth, and their normalised squares.
//
//   auto found = liestat::initialiseRecording(recording, options);
//   const auto compared = liestat::compareWithTruth(std::move(found), recording.image_times, truth, 9.81);
//   std::puts(compared.verdict().text.c_str());
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/imu/ground_truth.hpp>
#include <fusion/visual_inertial_truth_types.hpp>
#include <stats/gaussian.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <optional>
#include <span>

namespace liestat {

/// Squared Mahalanobis distance (NEES) of an error of (V, G, …) of size N + 1 with N degrees of freedom: gravity is on
/// its sphere, where its covariance has no part along it. `covariance` has N + 1 rows at least, in the order of the
/// error; the first ones are used. NaN unless it is positive definite across gravity. The one place where the errors of
/// a visual-inertial initialisation are normalised.
template <int N, class Covariance>
double neesOnSphere(const Eigen::Matrix<double, N + 1, 1>& error, const Covariance& covariance,
                    const Eigen::Vector3d& gravity) {
  // Any two axes across gravity do.
  const Eigen::Vector3d across = gravity.unitOrthogonal();
  Eigen::Matrix<double, N, N + 1> reduce = Eigen::Matrix<double, N, N + 1>::Zero();
  reduce.template topLeftCorner<3, 3>().setIdentity();
  reduce.template block<1, 3>(3, 3) = across.transpose();
  reduce.template block<1, 3>(4, 3) = gravity.normalized().cross(across).transpose();
  reduce.template bottomRightCorner<N - 5, N - 5>().setIdentity();
  const Eigen::Matrix<double, N + 1, N + 1> whole = covariance.template topLeftCorner<N + 1, N + 1>();
  const Eigen::Matrix<double, N + 1, N> half = whole * reduce.transpose();
  return mahalanobisSquared<double, N>(Eigen::Matrix<double, N, 1>(reduce * error),
                                       Eigen::Matrix<double, N, N>(reduce * half));
}

/// Compares windows and stretches with the truth at the times of their images (s, of the recording's); `truth` ascends
/// in time and may be empty. A window is compared where the truth is known at each of its images. `gravity`: its length
/// in m/s², none where it was not known (then 9.81 is taken for the errors, and there is no NEES).
LIESTAT_FUSION_API ComparedRecording compareWithTruth(VisualInertialResult found, std::span<const double> image_times,
                                                      std::span<const GroundTruth> truth,
                                                      std::optional<double> gravity);

}  // namespace liestat

#ifdef LIESTAT_HEADER_ONLY
#include <fusion/init/detail/compare_with_truth.hpp>
#endif
