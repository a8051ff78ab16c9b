// With LIESTAT_COMPILED_MEANS defined, the means of the common features are declared only: a unit that asks for one
// compiles in a fraction of the time, and those of stats/compiled/ hold them. Ends stats/mean.hpp.
#pragma once

#include <stats/detail/any_executor.hpp>
#include <stats/mean.hpp>

#include <lie/crystal_orientation.hpp>
#include <lie/frame3.hpp>
#include <lie/non_oriented_frame3.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se3.hpp>
#include <lie/semi_oriented_frame3.hpp>
#include <lie/so3.hpp>

/// `instantiate` is template (a definition) or extern template.
#define LIESTAT_INSTANTIATE_MEAN(instantiate, M)                                                          \
  instantiate MeanResult<M> frechetMean<M>(const AnyExecutor&, const Samples<M>&, const UnitWeights&,     \
                                           const MeanOptions<M>&);                                        \
  instantiate MeanResult<M> frechetMean<M>(const AnyExecutor&, const Samples<M>&, const Samples<double>&, \
                                           const MeanOptions<M>&)

/// `apply`, a macro of the two arguments above, for each feature whose mean by any criterion is compiled. Orientations
/// of crystals have no Mahalanobis mean, and a unit of their own.
#define LIESTAT_FOR_EACH_MEAN(apply, instantiate) \
  apply(instantiate, Eigen::Vector3d);            \
  apply(instantiate, SO3d);                       \
  apply(instantiate, S2d);                        \
  apply(instantiate, Frame3d);                    \
  apply(instantiate, SemiOrientedFrame3d);        \
  apply(instantiate, NonOrientedFrame3d)

namespace liestat::detail {

LIESTAT_FOR_EACH_MEAN(LIESTAT_INSTANTIATE_MEAN, extern template);
LIESTAT_INSTANTIATE_MEAN(extern template, CrystalOrientation);

}  // namespace liestat::detail
