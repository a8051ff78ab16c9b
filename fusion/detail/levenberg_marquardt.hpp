// Levenberg's and Marquardt's method: Gauss and Newton's steps, damped until the cost decreases. One loop for all
// problems of fusion/.
#pragma once

#include <fusion/status.hpp>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <limits>

namespace liestat::detail {

/// A problem that the method can solve, which stands somewhere and can look at one step from there.
template <class P>
concept DampedProblem = requires(P& problem, double damping) {
  { problem.linearise() } -> std::convertible_to<double>;  ///< the cost (χ²) and the normal equations where it stands
  { problem.solve(damping) } -> std::convertible_to<bool>;     ///< their step, diagonal times 1 + damping; false: none
  { problem.costAfterStep() } -> std::convertible_to<double>;  ///< infinite or NaN where the step is not allowed
  problem.accept();                                            ///< stands at the end of the step from now on
  problem.reject();                                            ///< stays, as linearised
};

struct DampedOptions {
  int max_iterations = 50;
  double min_decrease = 1e-3;  ///< of the cost: below it, with little damping, it has converged
  double damping = 1e-4;       ///< of the first step
};

/// How a minimisation ended.
struct DampedSummary {
  double cost = std::numeric_limits<double>::infinity();
  int iterations = 0;
  FusionStatus status = FusionStatus::not_converged;  ///< or ok
};

/// Minimises from where the problem stands, and leaves it at the best point that was found.
template <DampedProblem Problem>
DampedSummary minimiseDamped(Problem& problem, const DampedOptions& options) {
  DampedSummary summary;
  summary.cost = problem.linearise();
  double damping = options.damping;
  while (summary.iterations < options.max_iterations && std::isfinite(summary.cost)) {
    ++summary.iterations;
    const bool solved = problem.solve(damping);
    const double next = solved ? problem.costAfterStep() : std::numeric_limits<double>::infinity();
    // Written so that NaN is no progress.
    if (!(next < summary.cost)) {
      if (solved) problem.reject();
      // At the minimum rounding decides.
      if (next <= summary.cost + 1e-9 * (1 + summary.cost)) {
        summary.status = FusionStatus::ok;
        return summary;
      }
      damping *= 10;
      if (damping > 1e10) return summary;
      continue;
    }
    const double decrease = summary.cost - next;
    problem.accept();
    summary.cost = problem.linearise();
    damping = std::max(1e-10, 0.1 * damping);
    if (decrease < options.min_decrease && damping < 1) {
      summary.status = FusionStatus::ok;
      return summary;
    }
  }
  return summary;
}

}  // namespace liestat::detail
