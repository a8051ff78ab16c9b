// Levenberg–Marquardt: Gauss–Newton steps with the damping raised until the cost decreases. One loop for all nonlinear
// least-squares problems of fusion/.
#pragma once

#include <fusion/status.hpp>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <limits>

namespace liestat::detail {

/// A least-squares problem with a current point and one candidate step from it.
template <class P>
concept DampedProblem = requires(P& problem, double damping) {
  { problem.linearise() } -> std::convertible_to<double>;      ///< cost (χ²) and normal equations at the point
  { problem.solve(damping) } -> std::convertible_to<bool>;     ///< step for a diagonal times 1 + damping; false: none
  { problem.costAfterStep() } -> std::convertible_to<double>;  ///< infinite or NaN if the step is not allowed
  problem.accept();                                            ///< moves the point to the end of the step
  problem.reject();                                            ///< drops the step
};

struct DampedOptions {
  int max_iterations = 50;
  double min_decrease = 1e-3;  ///< converged if the cost decreases by less, with damping below 1
  double damping = 1e-4;       ///< initial damping
};

/// The factor by which a step that fails raises the damping, and one that succeeds lowers it.
inline constexpr double damping_factor = 10;
/// Below the first the steps are Gauss–Newton's; above the second they no longer change the parameters in double.
inline constexpr double min_damping = 1e-10, max_damping = 1e10;
/// Relative increase of the cost that rounding explains: the point is then at the minimum.
inline constexpr double rounding_of_cost = 1e-9;

/// The end of a minimisation.
struct DampedSummary {
  double cost = std::numeric_limits<double>::infinity();
  int iterations = 0;
  FusionStatus status = FusionStatus::not_converged;  ///< ok or not_converged
};

/// Minimises from the problem's point and leaves it at the best point found; a cost that is not finite ends it at once.
template <DampedProblem Problem>
DampedSummary minimiseDamped(Problem& problem, const DampedOptions& options) {
  DampedSummary summary;
  summary.cost = problem.linearise();
  double damping = options.damping;
  while (summary.iterations < options.max_iterations && std::isfinite(summary.cost)) {
    ++summary.iterations;
    const bool solved = problem.solve(damping);
    const double next = solved ? problem.costAfterStep() : std::numeric_limits<double>::infinity();
    // The negation, so that NaN counts as no decrease.
    if (!(next < summary.cost)) {
      if (solved) problem.reject();
      if (next <= summary.cost + rounding_of_cost * (1 + summary.cost)) {
        summary.status = FusionStatus::ok;
        return summary;
      }
      damping *= damping_factor;
      if (damping > max_damping) return summary;
      continue;
    }
    const double decrease = summary.cost - next;
    problem.accept();
    summary.cost = problem.linearise();
    damping = std::max(min_damping, damping / damping_factor);
    if (decrease < options.min_decrease && damping < 1) {
      summary.status = FusionStatus::ok;
      return summary;
    }
  }
  return summary;
}

}  // namespace liestat::detail
