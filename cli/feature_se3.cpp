// All that is a template of the feature, in one unit: its parts share most of what they instantiate.

#include <cli/split_impl.hpp>

namespace liestat::cli::detail {

template MeanAnalysis analyse<SE3d>(const Measures&, const AnalysisOptions&);
template SplitResult split<SE3d>(const Measures&, const SplitPlan&, int);

}  // namespace liestat::cli::detail
