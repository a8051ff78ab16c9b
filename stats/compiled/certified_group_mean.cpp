#include <stats/detail/compiled_certified_group_mean.hpp>

namespace liestat::detail {

LIESTAT_INSTANTIATE_CERTIFIED_GROUP_MEAN(template, SE3d);

}  // namespace liestat::detail
