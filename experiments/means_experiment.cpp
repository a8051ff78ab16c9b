#include <experiments/interruption.hpp>
#include <experiments/means_report.hpp>
#include <experiments/means_trial.hpp>
#include <experiments/parallel.hpp>
#include <stats/validation.hpp>

#include <cmath>

namespace liestat::experiments {
namespace {

/// Logarithm of the ratio of two errors.
double logRatio(double error, double reference) { return std::log(error / reference); }

/// The outcomes of which the reports are made, in the order of the methods that are wanted.
std::vector<MeansOutcome> wantedOutcomes(const MeansExperiment& experiment, const MethodOutcomes& outcomes) {
  std::vector<MeansOutcome> list;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    if (!experiment.wanted[m]) continue;
    const MethodOutcome& o = outcomes[m];
    const bool is_maha = methods[m].criterion == Criterion::maha;
    const MethodOutcome& reference = outcomes[methodIndex({Criterion::maha, methods[m].corrected || is_maha, true})];
    MeansOutcome outcome;
    outcome.mu2 = o.mahalanobis_squared;
    outcome.iterations = o.iterations;
    outcome.log_ratio_rotation = logRatio(o.rotation_error, reference.rotation_error);
    outcome.log_ratio_translation = logRatio(o.translation_error, reference.translation_error);
    list.push_back(outcome);
  }
  return list;
}

}  // namespace

std::size_t methodIndex(const Method& method) {
  std::size_t i = 0;
  while (i + 1 < methods.size() &&
         !(methods[i].criterion == method.criterion && methods[i].corrected == method.corrected &&
           methods[i].known_noise == method.known_noise)) {
    ++i;
  }
  return i;
}

std::vector<MeansReport> run(const MeansExperiment& experiment, int threads,
                             const std::function<void(std::size_t, std::size_t)>& progress) {
  const int k = degreesOfFreedom(experiment.feature);
  std::vector<ReferenceLaw> laws;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    if (!experiment.wanted[m]) continue;
    laws.push_back(methods[m].known_noise ? ReferenceLaw::chiSquared(k)
                                          : ReferenceLaw::hotelling(k, static_cast<int>(experiment.n)));
  }
  const ValidationOptions options{
      .trials = experiment.trials, .seed = experiment.seed, .progress = progress, .stop = runStopped};
  return validateAll(ProgramExecutor{threads}, options, laws, [&](CounterRng& rng, std::uint64_t) {
    return wantedOutcomes(experiment, meansTrial(experiment, rng));
  });
}

}  // namespace liestat::experiments
