// Means of the features that liestat_means holds compiled.
#include <python/src/mean_of.hpp>

#include <formats/feature.hpp>

#include <algorithm>
#include <array>

namespace liestat::python {
namespace {

template <class M>
constexpr MeanType commonType(std::string_view name) {
  return meanType<M>(name, info<M>().name);
}

constexpr std::array types{
    commonType<Eigen::Vector3d>("R3"),
    commonType<SO3d>("SO3"),
    commonType<S2d>("S2"),
    commonType<Frame3d>("Frame3"),
    commonType<SemiOrientedFrame3d>("SemiOrientedFrame3"),
    commonType<NonOrientedFrame3d>("NonOrientedFrame3"),
    commonType<SE3d>("SE3"),
};

}  // namespace

const MeanType* commonMeans(std::string_view name) {
  const auto* found = std::find_if(types.begin(), types.end(), [&](const MeanType& t) { return t.name == name; });
  return found == types.end() ? nullptr : found;
}

}  // namespace liestat::python
