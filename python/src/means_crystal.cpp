// Means of orientations of crystals: rotations modulo the point group of a request.
#include <python/src/array_operations.hpp>
#include <python/src/means.hpp>
#include <lie/crystal_orientation.hpp>
#include <stats/summarized_mean.hpp>

#include <vector>

namespace liestat::python {
namespace {

MeanSummary meanOfCrystals(const MeanRequest& request, SignalWatch& signals) {
  std::vector<CrystalOrientation> features;
  for (std::size_t i = 0; i + 4 <= request.features.size(); i += 4) {
    features.emplace_back(point<SO3d>(request.features.data() + i), request.symmetry);
  }
  MeanInput<CrystalOrientation> input{.criterion = request.criterion,
                                      .features = features,
                                      .weights = request.weights,
                                      .refuted_noise = request.refuted_noise,
                                      .weights_are = request.weights_are,
                                      .scale_noise = request.birge,
                                      .region = request.region,
                                      .times = request.times,
                                      .inflate = request.inflate};
  for (std::size_t i = 0; i + 9 <= request.covariances.size(); i += 9) {
    const Eigen::Matrix3d matrix = square<3>(request.covariances.data() + i);
    input.covariances.push_back(request.factored ? Eigen::Matrix3d(matrix * matrix.transpose()) : matrix);
  }
  MeanSummaryOptions how;
  how.certificates = request.certify;
  if (request.budget > 0) how.uniqueness.budget = request.budget;
  how.uniqueness.progress = [&signals](double) { signals.look(); };
  return summarizedMean(PythonExecutor{request.threads, &signals}, input, how);
}

}  // namespace

const MeanType* crystalMeans(std::string_view name) {
  static constexpr MeanType type{"CrystalOrientation", "crystal_orientation", 4, 3, meanOfCrystals, nullptr, nullptr};
  return name == type.name ? &type : nullptr;
}

}  // namespace liestat::python
