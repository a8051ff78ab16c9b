#include <experiments/propagation_experiment.hpp>

#include <experiments/interruption.hpp>
#include <experiments/parallel.hpp>
#include <experiments/propagation_trial.hpp>

namespace liestat::experiments {

int degreesOfFreedom(Propagated feature, Operation operation) {
  if (operation == Operation::act || feature == Propagated::rotation) return 3;
  return feature == Propagated::pose ? 6 : 7;
}

std::vector<ValidationReport> run(const PropagationExperiment& experiment, int threads,
                                  const std::function<void(std::size_t, std::size_t)>& progress) {
  std::vector<ReferenceLaw> laws;
  for (const PropagationMethod& method : experiment.methods) {
    laws.push_back(ReferenceLaw::chiSquared(degreesOfFreedom(experiment.feature, method.operation)));
  }
  // A trial takes microseconds.
  const ValidationOptions options{.trials = experiment.trials,
                                  .seed = experiment.seed,
                                  .chunk_size = 256,
                                  .progress = progress,
                                  .stop = runStopped};
  return validateAll(ProgramExecutor{threads}, options, laws,
                     [&](CounterRng& rng, std::uint64_t) { return propagationTrial(experiment, rng); });
}

}  // namespace liestat::experiments
