// Declares the compiled certified Mahalanobis means of the common features (stats/detail/compiled_mean.hpp). Ends
// stats/certified_maha.hpp.
#pragma once

#include <stats/certified_maha.hpp>
#include <stats/detail/compiled_maha.hpp>

#define LIESTAT_INSTANTIATE_CERTIFIED_MAHA(instantiate, M)                                                         \
  instantiate CertifiedMaha<M> findCertifiedMaha<M>(const AnyExecutor&, const Samples<Gaussian<M>>&, CovarianceAt, \
                                                    const CertifiedMahaOptions<M>&, std::span<const SquareOf<M>>)

namespace liestat::detail {

LIESTAT_FOR_EACH_MEAN(LIESTAT_INSTANTIATE_CERTIFIED_MAHA, extern template);
LIESTAT_INSTANTIATE_CERTIFIED_MAHA(extern template, SE3d);

}  // namespace liestat::detail
