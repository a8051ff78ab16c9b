// Means of the features that liestat_means holds compiled.
#include <python/src/mean_of.hpp>

#include <lie/frame3.hpp>
#include <lie/non_oriented_frame3.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se3.hpp>
#include <lie/semi_oriented_frame3.hpp>
#include <lie/so3.hpp>

#include <algorithm>
#include <array>

namespace liestat::python {
namespace {

template <class M>
constexpr MeanType metricType(std::string_view name) {
  return {name, leastSquares<M>, leastMahalanobis<M>, nullptr, fuseFeatures<M>};
}

constexpr std::array types{
    metricType<Eigen::Vector3d>("R3"),
    metricType<SO3d>("SO3"),
    metricType<S2d>("S2"),
    metricType<Frame3d>("Frame3"),
    metricType<SemiOrientedFrame3d>("SemiOrientedFrame3"),
    metricType<NonOrientedFrame3d>("NonOrientedFrame3"),
    MeanType{"SE3", nullptr, leastMahalanobis<SE3d>, barycentre<SE3d>, fuseFeatures<SE3d>},
};

}  // namespace

const MeanType* commonMeans(std::string_view name) {
  const auto* found = std::find_if(types.begin(), types.end(), [&](const MeanType& t) { return t.name == name; });
  return found == types.end() ? nullptr : found;
}

}  // namespace liestat::python
