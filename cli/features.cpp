// The trials of the means experiment for every feature, in one unit: they share nearly all that they instantiate, so
// that a second type costs a compiler an eighth of the first.

#include <experiments/means_experiment_impl.hpp>

namespace liestat::experiments::detail {

template MethodOutcomes runTrial<Eigen::Vector3d>(const MeansExperiment&, CounterRng&);
template MethodOutcomes runTrial<SO3d>(const MeansExperiment&, CounterRng&);
template MethodOutcomes runTrial<S2d>(const MeansExperiment&, CounterRng&);
template MethodOutcomes runTrial<Frame3d>(const MeansExperiment&, CounterRng&);
template MethodOutcomes runTrial<SemiOrientedFrame3d>(const MeansExperiment&, CounterRng&);
template MethodOutcomes runTrial<NonOrientedFrame3d>(const MeansExperiment&, CounterRng&);

}  // namespace liestat::experiments::detail
