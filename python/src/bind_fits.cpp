// Fits of curves, surfaces, maps and laws for Python.
#include <python/src/binding.hpp>
#include <python/src/described.hpp>
#include <stats/directional_laws.hpp>
#include <stats/fit_summary.hpp>

#include <Eigen/Core>
#include <pybind11/stl.h>

#include <cstdint>
#include <optional>
#include <string>

namespace liestat::python {
namespace {

using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

py::dict fit(const std::string& model, const DoubleArray& points, std::optional<double> sigma, bool birge) {
  const Eigen::MatrixXd list = Eigen::Map<const Rows>(points.data(), points.shape(0), points.shape(1));
  FitOptions options;
  if (birge) options.noise = StatedNoise::scaled;
  FitSummary found;
  {
    const py::gil_scoped_release released;
    found = summarizedFit(*named<FitModel>(model), list, sigma, options);
  }
  return dictWithSeries(found);
}

py::dict fitOfLaw(const std::string& law, const DoubleArray& features, std::uint64_t seed) {
  const Eigen::MatrixXd rows = Eigen::Map<const Rows>(features.data(), features.shape(0), features.shape(1));
  LawFit found;
  {
    const py::gil_scoped_release released;
    LawFitOptions options;
    options.seed = seed;
    found = fitLaw(*named<LawModel>(law), Eigen::Ref<const Eigen::MatrixXd>(rows), options);
  }
  return dictOf(found);
}

/// The names of the coordinates of each model's points.
py::dict models() {
  py::dict all;
  const auto names = words(FitModel{});
  for (std::size_t k = 0; k < names.size(); ++k) {
    all[names[k]] = DictView::of(coordinateNames(static_cast<FitModel>(k)));
  }
  return all;
}

}  // namespace

void bindFits(py::module_& module) {
  module.def("fit", &fit);
  module.def("fit_models", &models);
  module.def("fit_law", &fitOfLaw);
}

}  // namespace liestat::python
