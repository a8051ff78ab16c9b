// A second motion that tracks agree on, for fusion/init/robust_initialisation.hpp.
//
// An inertial sensor does not see its own velocity, so a camera that moves past the world and one that is passed by a
// body in uniform motion have equally good solutions. Which of the two groups of tracks is the world is not in the data;
// the larger one need not be.
#pragma once

#include <fusion/imu/window.hpp>
#include <fusion/init/consensus.hpp>
#include <fusion/init/results.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/random.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

namespace liestat::detail {

/// True if the velocities of two solutions, which are of disjoint tracks, differ by more than their covariances say,
/// p < 1e-4. Without covariances, of exact data, by more than a millionth.
inline bool areDistinct(const ClosedFormResult& a, const ClosedFormResult& b) {
  const Eigen::Vector3d difference = a.solutions[0].velocity - b.solutions[0].velocity;
  if (a.covariance.size() == 0 || b.covariance.size() == 0) {
    return difference.norm() > 1e-6 * (1 + a.solutions[0].velocity.norm());
  }
  const Eigen::Matrix3d covariance = a.covariance.topLeftCorner<3, 3>() + b.covariance.topLeftCorner<3, 3>();
  return Cholesky<double, 3>(covariance).ok() && mahalanobisSquared<double, 3>(difference, covariance) > 21.1;
}

/// The motion of the tracks that do not agree with a first solution, if a part of all that chance does not explain
/// (SecondMotionOptions) agrees on one, as consistent as noise, and distinct from the first.
inline std::optional<SecondMotion> secondMotion(const InertialWindow& window, const ImuBias<double>& bias,
                                                const ClosedFormResult& first, const std::vector<std::size_t>& inliers,
                                                const std::vector<std::size_t>& outliers,
                                                const InitialisationOptions& options) {
  const double tracks = static_cast<double>(inliers.size() + outliers.size());
  const std::size_t least = std::max(static_cast<std::size_t>(std::ceil(options.second_motion.min_part * tracks)),
                                     options.consensus.features_drawn + options.second_motion.beyond_drawn);
  if (!first.hasMotion() || outliers.size() < least) return std::nullopt;
  InitialisationOptions how = options;
  how.consensus.seed = CounterRng(options.consensus.seed, 1, 1)();
  ConsensusResult second = solveClosedFormRobustly(closedFormWindow(window.without(inliers), bias), how);
  if (second.hypotheses == 0 || second.inliers.size() < least || !second.result.hasMotion() ||
      !second.result.consistent || !areDistinct(first, second.result)) {
    return std::nullopt;
  }
  return SecondMotion{std::move(second.result), std::move(second.inliers)};
}

/// Adds a second motion to what was found, the one that more tracks agree on first.
inline void addSecondMotion(const InertialWindow& window, const ImuBias<double>& bias,
                            const InitialisationOptions& options, RobustInitialisation& found) {
  if (!options.second_motion.search || found.result.fault || found.inliers.empty()) return;
  found.second = secondMotion(window, bias, found.result, found.inliers, found.outliers, options);
  if (!found.second) return;
  std::vector<std::size_t> all;
  std::merge(found.inliers.begin(), found.inliers.end(), found.outliers.begin(), found.outliers.end(),
             std::back_inserter(all));
  if (found.second->inliers.size() > found.inliers.size()) {
    std::swap(found.second->inliers, found.inliers);
    std::swap(found.second->result, found.result);
    found.outliers.clear();
    std::set_difference(all.begin(), all.end(), found.inliers.begin(), found.inliers.end(),
                        std::back_inserter(found.outliers));
  }
  found.status = FusionStatus::ambiguous;
}

}  // namespace liestat::detail
