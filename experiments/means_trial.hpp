#pragma once

#include <experiments/means_experiment.hpp>
#include <stats/random.hpp>

#include <array>
#include <limits>

namespace liestat::experiments {

inline constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

/// The result of one method in one trial.
struct MethodOutcome {
  double mahalanobis_squared = not_a_number;  ///< the truth's, about the estimate; NaN if the method failed
  int iterations = 0;                         ///< started at the first measurement
  double rotation_error = not_a_number;       ///< rad; NaN where the feature has no orientation
  double translation_error = not_a_number;    ///< m; NaN where the feature has no position
};
using MethodOutcomes = std::array<MethodOutcome, methods.size()>;

/// One trial of an experiment: a scene from the generator, and what each of `methods` that is wanted makes of it.
MethodOutcomes meansTrial(const MeansExperiment& experiment, CounterRng& rng);

}  // namespace liestat::experiments
