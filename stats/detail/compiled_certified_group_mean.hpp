// Declares the compiled certified barycentre of rigid motions (stats/detail/compiled_mean.hpp). Ends
// stats/certified_group_mean.hpp.
#pragma once

#include <stats/certified_group_mean.hpp>

#include <lie/se3.hpp>

#define LIESTAT_INSTANTIATE_CERTIFIED_GROUP_MEAN(instantiate, G) \
  instantiate CertifiedGroupMean<G> findCertifiedGroupMean<G>(   \
      const AnyExecutor&, const Samples<G>&, const Samples<double>&, const CertifiedGroupMeanOptions<G>&)

namespace liestat::detail {

LIESTAT_INSTANTIATE_CERTIFIED_GROUP_MEAN(extern template, SE3d);

}  // namespace liestat::detail
