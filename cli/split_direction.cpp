#include <cli/split_impl.hpp>

namespace liestat::cli::detail {

template SplitResult split<S2d>(const Measures&, const SplitPlan&, int);

}  // namespace liestat::cli::detail
