// Means of rigid motions of the plane.
#include <python/src/mean_of.hpp>

#include <lie/frame2.hpp>
#include <lie/se2.hpp>

namespace liestat::python {

const MeanType* planarMeans(std::string_view name) {
  static constexpr MeanType type{"SE2", nullptr, leastMahalanobis<SE2d>, barycentre<SE2d>, fuseFeatures<SE2d>};
  return name == type.name ? &type : nullptr;
}

}  // namespace liestat::python
