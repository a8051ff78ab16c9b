// All that is a template of the feature, in one unit: its parts share most of what they instantiate.

#include <cli/means_experiment_impl.hpp>
#include <cli/split_impl.hpp>

namespace liestat::cli::detail {

template MeanAnalysis analyse<NonOrientedFrame3d>(const Measures&, const AnalysisOptions&);
template SplitResult split<NonOrientedFrame3d>(const Measures&, const SplitPlan&, int);
template MethodOutcomes runTrial<NonOrientedFrame3d>(const MeansExperiment&, CounterRng&);

}  // namespace liestat::cli::detail
