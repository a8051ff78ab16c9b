// Laws of squared Mahalanobis distances and confidence ellipsoids for Python.
#include <python/src/binding.hpp>
#include <stats/inference.hpp>
#include <stats/laws.hpp>

#include <Eigen/Core>

namespace liestat::python {
namespace {

/// Hotelling's law of `samples` features, χ² for none.
ReferenceLaw law(int dof, int samples) {
  return samples > 0 ? ReferenceLaw::hotelling(dof, samples) : ReferenceLaw::chiSquared(dof);
}

py::tuple ellipsoidOf(const DoubleArray& covariance, double threshold) {
  const auto k = covariance.shape(0);
  const Eigen::MatrixXd matrix =
      Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(covariance.data(), k, k);
  const auto region = ellipsoid(matrix, threshold);
  DoubleArray semi_axes(k);
  DoubleArray directions({k, k});
  for (py::ssize_t i = 0; i < k; ++i) {
    semi_axes.mutable_at(i) = region.semi_axes[i];
    for (py::ssize_t j = 0; j < k; ++j) directions.mutable_at(i, j) = region.directions(i, j);
  }
  return py::make_tuple(semi_axes, directions, region.valid);
}

}  // namespace

void bindLaws(py::module_& module) {
  using namespace py::literals;
  module.def("law_quantile", [](int k, int n, double p) { return law(k, n).quantile(p); });
  module.def("law_survival", [](int k, int n, double mu2) { return law(k, n).survival(mu2); });
  module.def("law_mean", [](int k, int n) { return law(k, n).mean(); });
  module.def("ellipsoid", &ellipsoidOf);
}

}  // namespace liestat::python
