#include <cli/means_experiment_impl.hpp>

namespace liestat::cli::detail {

template std::vector<ValidationReport> runTrials<SemiOrientedFrame3d>(
    const MeansExperiment&, int, const std::function<void(std::size_t, std::size_t)>&);

}  // namespace liestat::cli::detail
