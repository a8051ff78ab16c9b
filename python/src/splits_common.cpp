// Splits of the features that liestat_means holds compiled; apart from their means, so that two compilers share the work.
#include <python/src/split_of.hpp>

#include <formats/feature.hpp>

namespace liestat::python {

#define LIESTAT_SPLIT_OF(M) template SplitSummary splitOf<M>(const MeanRequest&, SignalWatch&, const SplitOptions&)
LIESTAT_SPLIT_OF(Eigen::Vector3d);
LIESTAT_SPLIT_OF(SO3d);
LIESTAT_SPLIT_OF(S2d);
LIESTAT_SPLIT_OF(Frame3d);
LIESTAT_SPLIT_OF(SemiOrientedFrame3d);
LIESTAT_SPLIT_OF(NonOrientedFrame3d);
LIESTAT_SPLIT_OF(SE3d);
#undef LIESTAT_SPLIT_OF

}  // namespace liestat::python
