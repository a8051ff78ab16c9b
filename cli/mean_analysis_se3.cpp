#include <cli/mean_analysis_impl.hpp>

namespace liestat::cli::detail {

template MeanAnalysis analyse<SE3d>(const Measures&, const AnalysisOptions&);

}  // namespace liestat::cli::detail
