#include <cli/split_impl.hpp>

namespace liestat::cli::detail {

template SplitResult split<SO3d>(const Measures&, const SplitPlan&, int);

}  // namespace liestat::cli::detail
