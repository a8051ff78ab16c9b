#include <stats/detail/compiled_mean.hpp>

namespace liestat::detail {

LIESTAT_FOR_EACH_MEAN(LIESTAT_INSTANTIATE_MEAN, template);

}  // namespace liestat::detail
