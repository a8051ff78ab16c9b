// Means of orientations of crystals: rotations modulo the point group of a request.
#include <python/src/array_operations.hpp>
#include <python/src/mean_of.hpp>
#include <python/src/means.hpp>
#include <lie/crystal_orientation.hpp>

#include <vector>

namespace liestat::python {
namespace {

MeanSummary meanOfCrystals(const MeanRequest& request, SignalWatch& signals) {
  std::vector<CrystalOrientation> features;
  for (std::size_t i = 0; i + 4 <= request.features.size(); i += 4) {
    features.emplace_back(point<SO3d>(request.features.data() + i), request.symmetry);
  }
  return meanOfFeatures<CrystalOrientation>(request, features, signals);
}

}  // namespace

const MeanType* crystalMeans(std::string_view name) {
  static constexpr MeanType type{"CrystalOrientation", "crystal_orientation", 4, 3, meanOfCrystals, nullptr, nullptr};
  return name == type.name ? &type : nullptr;
}

}  // namespace liestat::python
