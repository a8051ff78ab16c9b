// Errors of the solvers of two-view motion over many scenes.
#pragma once

#include <experiments/two_view_scene.hpp>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace liestat_test {

using namespace liestat;
using experiments::TwoViewMotion;
using experiments::TwoViewScene;
using Matches = std::span<const Eigen::Vector4d>;

/// Distance of two matrices of norm one, whatever their signs.
inline double distance(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  const Eigen::Matrix3d x = a / a.norm(), y = b / b.norm();
  return std::min((x - y).norm(), (x + y).norm());
}
/// Distance of the nearest solution, infinite where there is none.
template <class Solutions>
double nearest(const Solutions& solutions, const Eigen::Matrix3d& truth) {
  double best = std::numeric_limits<double>::infinity();
  for (const Eigen::Matrix3d& M : solutions) best = std::min(best, distance(M, truth));
  return best;
}

/// Errors of a solver over disjoint samples of n exact matches, 100 matches a scene, sorted.
struct SolverErrors {
  std::vector<double> sorted;
  double solutions = 0;  ///< mean number

  double quantile(double p) const {
    return sorted[static_cast<std::size_t>(p * static_cast<double>(sorted.size() - 1))];
  }
  double shareBelow(double bound) const {
    const auto good = std::upper_bound(sorted.begin(), sorted.end(), bound) - sorted.begin();
    return static_cast<double>(good) / static_cast<double>(sorted.size());
  }
};
template <class Solve>
SolverErrors errorsOf(TwoViewMotion motion, std::size_t n, std::size_t scenes, const Solve& solve) {
  SolverErrors errors;
  for (std::uint64_t seed = 1; seed <= scenes; ++seed) {
    const TwoViewScene scene({.motion = motion, .outliers = 0}, seed);
    for (std::size_t i = 0; i + n <= scene.exact.size(); i += n) {
      const auto found = solve(Matches(scene.exact).subspan(i, n));
      errors.sorted.push_back(nearest(found, experiments::isEpipolar(motion) ? scene.F : scene.H));
      errors.solutions += static_cast<double>(found.size());
    }
  }
  std::sort(errors.sorted.begin(), errors.sorted.end());
  errors.solutions /= static_cast<double>(errors.sorted.size());
  return errors;
}

/// H ũ as an image point.
inline Eigen::Vector2d transferred(const Eigen::Matrix3d& H, const Eigen::Vector4d& m) {
  return (H * Eigen::Vector3d(m[0], m[1], 1)).hnormalized();
}

}  // namespace liestat_test
