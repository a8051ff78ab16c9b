#include <stats/detail/compiled_certified_mean.hpp>

namespace liestat::detail {

LIESTAT_FOR_EACH_MEAN(LIESTAT_INSTANTIATE_CERTIFIED_MEAN, template);

}  // namespace liestat::detail
