#include <cli/split_impl.hpp>

namespace liestat::cli::detail {

template SplitResult split<NonOrientedFrame3d>(const Measures&, const SplitPlan&, int);

}  // namespace liestat::cli::detail
