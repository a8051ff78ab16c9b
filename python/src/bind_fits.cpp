// Fits of curves, surfaces and maps for Python.
#include <python/src/binding.hpp>
#include <python/src/described.hpp>
#include <stats/fit_summary.hpp>

#include <Eigen/Core>
#include <pybind11/stl.h>

#include <optional>
#include <string>

namespace liestat::python {
namespace {

py::dict fit(const std::string& model, const DoubleArray& points, std::optional<double> sigma, bool birge) {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
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
}

}  // namespace liestat::python
