#include <stats/detail/compiled_certified_maha.hpp>

namespace liestat::detail {

LIESTAT_FOR_EACH_MEAN(LIESTAT_INSTANTIATE_CERTIFIED_MAHA, template);
LIESTAT_INSTANTIATE_CERTIFIED_MAHA(template, SE3d);

}  // namespace liestat::detail
