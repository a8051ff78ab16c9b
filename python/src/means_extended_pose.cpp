// Means of extended poses: rotation, position and velocity.
#include <python/src/mean_of.hpp>

#include <lie/se23.hpp>

namespace liestat::python {

const MeanType* extendedPoseMeans(std::string_view name) {
  static constexpr MeanType type{"SE23", nullptr, leastMahalanobis<SE23d>, barycentre<SE23d>, fuseFeatures<SE23d>};
  return name == type.name ? &type : nullptr;
}

}  // namespace liestat::python
