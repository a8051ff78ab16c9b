// Declares the compiled Mahalanobis means of the common features (stats/detail/compiled_mean.hpp). Ends stats/maha.hpp.
#pragma once

#include <stats/detail/compiled_mean.hpp>
#include <stats/maha.hpp>

#define LIESTAT_INSTANTIATE_MAHA(instantiate, M)                                                              \
  instantiate MahaResult<M> mahalanobisMean<M>(const AnyExecutor&, const Samples<Gaussian<M>>&, CovarianceAt, \
                                               const MahaOptions<M>&, std::span<const SquareOf<M>>);          \
  instantiate FuseResult<M> fused<M>(const Samples<Gaussian<M>>&, CovarianceAt, std::span<const SquareOf<M>>)

namespace liestat::detail {

LIESTAT_FOR_EACH_MEAN(LIESTAT_INSTANTIATE_MAHA, extern template);
LIESTAT_INSTANTIATE_MAHA(extern template, SE3d);

}  // namespace liestat::detail
