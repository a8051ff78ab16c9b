#include <cli/mean_analysis_impl.hpp>

namespace liestat::cli::detail {

template MeanAnalysis analyse<Eigen::Vector3d>(const Measures&, const AnalysisOptions&);

}  // namespace liestat::cli::detail
