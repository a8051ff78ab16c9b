// The definition of fusion/init/gyroscope_bias.hpp.
#pragma once

#include <fusion/detail/compiled.hpp>
#include <fusion/init/detail/gyroscope_bias_problem.hpp>
#include <fusion/detail/levenberg_marquardt.hpp>
#include <fusion/init/closed_form.hpp>
#include <fusion/init/gyroscope_bias.hpp>

#include <Eigen/Core>

#include <cmath>
#include <cstddef>
#include <vector>

namespace liestat {

namespace detail {

inline bool isUsable(const InitialisationOptions& o) {
  const GyroscopeBiasOptions& own = o.gyroscope_bias;
  return o.bearing_noise > 0 && o.prior.mean.gyroscope.allFinite() && o.prior.gyroscope_sigma > 0 &&
         std::isfinite(o.prior.gyroscope_sigma) && own.max_step > 0 && (!own.start || own.start->allFinite());
}

}  // namespace detail

LIESTAT_FUSION_INLINE GyroscopeBiasResult estimateGyroscopeBias(InertialWindow window,
                                                                const InitialisationOptions& options) {
  GyroscopeBiasResult found;
  ClosedFormResult& result = found.result;
  const GyroscopeBiasOptions& own = options.gyroscope_bias;
  found.bias = own.start.value_or(options.prior.mean.gyroscope);
  result.fault = window.fault();
  if (!result.fault && !detail::isUsable(options)) result.fault = FaultKind::bad_option;
  if (!result.fault && window.size() == 0) result.fault = FaultKind::too_few_images;
  if (result.fault) return found;
  const ImuBias<double> base = window.bias();
  const auto closedForm = [&] {
    const ImuBias<double> bias{found.bias, base.accelerometer};
    found.integrations += window.integrateIfFar(bias);
    result = solveClosedForm(closedFormWindow(window, bias), options);
    return !result.fault;
  };
  if (!closedForm()) return found;
  if (result.window <= own.min_window && options.prior.gyroscope_sigma > own.sigma_from_rest) {
    found.status = FusionStatus::window_too_short;
    return found;
  }
  found.status = FusionStatus::not_converged;
  while (found.rounds < own.max_rounds) {
    if (!result.hasMotion()) {
      found.status = FusionStatus::no_start;
      return found;
    }
    detail::GyroscopeBiasProblem problem(window, options, result, found.bias, base);
    if (problem.features() == 0) {
      found.status = FusionStatus::no_start;
      return found;
    }
    detail::ReducedSystem system(problem.blocks(), problem.features());
    const detail::DampedSummary summary =
        detail::minimiseDamped(problem, system, {.max_iterations = own.max_iterations, .min_decrease = 1e-3});
    ++found.rounds;
    found.iterations += summary.iterations;
    found.cost = summary.cost;
    const Eigen::Vector3d change = problem.state().gyroscope - found.bias;
    found.bias = problem.state().gyroscope;
    const bool regular = system.factor(0);
    if (regular) {
      const std::vector<double> inverse = system.inverse({detail::GyroscopeBiasProblem::gyroscope});
      for (int i = 0; i < 9; ++i) found.covariance(i / 3, i % 3) = inverse[static_cast<std::size_t>(i)];
    }
    closedForm();
    // A tenth of a sigma is nothing.
    if (converged(summary.status) && regular && change.norm() <= 0.1 * std::sqrt(found.covariance.trace())) {
      found.status = FusionStatus::ok;
      break;
    }
  }
  return found;
}

}  // namespace liestat
