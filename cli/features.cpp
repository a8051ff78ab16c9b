// All that is a template of the feature, for every feature, in one unit: they share nearly all that they instantiate,
// so that a second type costs a compiler an eighth of the first.

#include <experiments/means_experiment_impl.hpp>
#include <cli/split_impl.hpp>

namespace liestat::cli::detail {

template MeanAnalysis analyse<Eigen::Vector3d>(const Measures&, const AnalysisOptions&);
template MeanAnalysis analyse<SO3d>(const Measures&, const AnalysisOptions&);
template MeanAnalysis analyse<SE3d>(const Measures&, const AnalysisOptions&);
template MeanAnalysis analyse<S2d>(const Measures&, const AnalysisOptions&);
template MeanAnalysis analyse<Frame3d>(const Measures&, const AnalysisOptions&);
template MeanAnalysis analyse<SemiOrientedFrame3d>(const Measures&, const AnalysisOptions&);
template MeanAnalysis analyse<NonOrientedFrame3d>(const Measures&, const AnalysisOptions&);

template SplitResult split<Eigen::Vector3d>(const Measures&, const SplitPlan&, int);
template SplitResult split<SO3d>(const Measures&, const SplitPlan&, int);
template SplitResult split<SE3d>(const Measures&, const SplitPlan&, int);
template SplitResult split<S2d>(const Measures&, const SplitPlan&, int);
template SplitResult split<Frame3d>(const Measures&, const SplitPlan&, int);
template SplitResult split<SemiOrientedFrame3d>(const Measures&, const SplitPlan&, int);
template SplitResult split<NonOrientedFrame3d>(const Measures&, const SplitPlan&, int);

}  // namespace liestat::cli::detail

namespace liestat::experiments::detail {

template MethodOutcomes runTrial<Eigen::Vector3d>(const MeansExperiment&, CounterRng&);
template MethodOutcomes runTrial<SO3d>(const MeansExperiment&, CounterRng&);
template MethodOutcomes runTrial<S2d>(const MeansExperiment&, CounterRng&);
template MethodOutcomes runTrial<Frame3d>(const MeansExperiment&, CounterRng&);
template MethodOutcomes runTrial<SemiOrientedFrame3d>(const MeansExperiment&, CounterRng&);
template MethodOutcomes runTrial<NonOrientedFrame3d>(const MeansExperiment&, CounterRng&);

}  // namespace liestat::experiments::detail
