#pragma once

#include <experiments/propagation_experiment.hpp>

namespace liestat::experiments {

/// One trial of an experiment: an outcome for each of its methods.
std::vector<TrialOutcome> propagationTrial(const PropagationExperiment& experiment, CounterRng& rng);

}  // namespace liestat::experiments
