// All that is a template of the feature, in one unit: its parts share most of what they instantiate.

#include <cli/means_experiment_impl.hpp>
#include <cli/split_impl.hpp>

namespace liestat::cli::detail {

template MeanAnalysis analyse<S2d>(const Measures&, const AnalysisOptions&);
template SplitResult split<S2d>(const Measures&, const SplitPlan&, int);
template MethodOutcomes runTrial<S2d>(const MeansExperiment&, CounterRng&);

}  // namespace liestat::cli::detail
