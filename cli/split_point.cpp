#include <cli/split_impl.hpp>

namespace liestat::cli::detail {

template SplitResult split<Eigen::Vector3d>(const Measures&, const SplitPlan&, int);

}  // namespace liestat::cli::detail
