#include <stats/detail/compiled_certified_mean.hpp>

namespace liestat::detail {

LIESTAT_INSTANTIATE_MEAN(template, CrystalOrientation);
LIESTAT_INSTANTIATE_CERTIFIED_MEAN(template, CrystalOrientation);

}  // namespace liestat::detail
