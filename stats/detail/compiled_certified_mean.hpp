// Declares the compiled certified means of the common features (stats/detail/compiled_mean.hpp). Ends
// stats/certified_mean.hpp.
#pragma once

#include <stats/certified_mean.hpp>
#include <stats/detail/compiled_mean.hpp>

#define LIESTAT_INSTANTIATE_CERTIFIED_MEAN(instantiate, M)                                                            \
  instantiate CertifiedMean<M> findCertifiedMean<M>(const AnyExecutor&, const Samples<M>&, const Samples<double>&,    \
                                                    const CertifiedMeanOptions<M>&, const MeanResult<M>&);            \
  instantiate double bootstrapWidening<M>(const Samples<M>&, const Samples<double>&, const MeanResult<M>&,            \
                                          ResidualNoise, double, const BootstrapOptions&);                            \
  instantiate bool certifyBySums<M>(const WeightSums&, const CertifiedMeanOptions<M>&, CertifiedMean<M>&);            \
  instantiate UniquenessResult<M> findUniqueness<M>(const AnyExecutor&, const Samples<M>&, const Samples<double>&,    \
                                                    const MeanResult<M>&, const UniquenessOptions&);                  \
  instantiate std::vector<NearTie<M>> findNearTies<M>(const AnyExecutor&, const Samples<M>&, const Samples<double>&,  \
                                                      const MeanResult<M>&, const SquareOf<M>&, bool, const NoNoise&, \
                                                      const NearTieOptions&)

namespace liestat::detail {

LIESTAT_FOR_EACH_MEAN(LIESTAT_INSTANTIATE_CERTIFIED_MEAN, extern template);
LIESTAT_INSTANTIATE_CERTIFIED_MEAN(extern template, CrystalOrientation);

}  // namespace liestat::detail
