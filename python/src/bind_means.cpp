// Means for Python: arrays in, a dictionary of what is known out.
#include <python/src/binding.hpp>
#include <python/src/means.hpp>

#include <cmath>
#include <map>
#include <string>

namespace liestat::python {
namespace {

const MeanType& typeOf(const std::string& name) {
  for (const auto find : {commonMeans, planarMeans, extendedPoseMeans}) {
    if (const MeanType* type = find(name)) return *type;
  }
  throw py::type_error("no means of " + name);
}

py::dict answerOf(const MeanAnswer& answer) {
  const auto p = static_cast<py::ssize_t>(answer.mean.size());
  const auto rows = [&](const std::vector<double>& list) {
    return arrayOf(list, {p > 0 ? static_cast<py::ssize_t>(list.size()) / p : 0, p});
  };
  const auto matrix = [&](const std::vector<double>& list) -> py::object {
    if (list.empty()) return py::none();
    const auto k = static_cast<py::ssize_t>(std::lround(std::sqrt(static_cast<double>(list.size()))));
    return arrayOf(list, {k, k});
  };
  py::dict d;
  d["n"] = answer.n;
  d["mean"] = arrayOf(answer.mean, {p});
  d["covariance"] = matrix(answer.covariance);
  d["dispersion"] = matrix(answer.dispersion);
  d["rivals"] = rows(answer.rivals);
  d["near_ties"] = rows(answer.near_ties);
  d["near_tie_z"] = arrayOf(answer.near_tie_z, {static_cast<py::ssize_t>(answer.near_tie_z.size())});
  d["status"] = text(answer.status);
  d["reason"] = text(answer.reason);
  d["uniqueness"] = text(answer.uniqueness);
  d["proof"] = text(answer.proof);
  d["converged"] = answer.converged;
  d["more_rivals"] = answer.more_rivals;
  d["concentrated"] = answer.concentrated;
  d["iterations"] = answer.iterations;
  d["residual"] = answer.residual;
  d["tolerance"] = answer.tolerance;
  d["cost"] = answer.cost;
  d["r_star"] = answer.r_star;
  d["cells"] = answer.cells;
  d["hessian_change"] = answer.hessian_change;
  d["fit"] = answer.fit;
  d["fit_dof"] = answer.fit_dof;
  d["law_samples"] = answer.law_samples;
  return d;
}

py::dict mean(const std::string& type, const std::string& criterion, const DoubleArray& features,
              const DoubleArray& weights, const DoubleArray& covariances, bool covariances_at_measurement,
              bool likelihood, bool certify, std::size_t budget, int threads) {
  const MeanType& means = typeOf(type);
  const MeanFunction function = criterion == "maha"         ? means.mahalanobis
                                : criterion == "barycentre" ? means.barycentre
                                                            : means.least_squares;
  if (function == nullptr) throw py::value_error(type + " has no criterion " + criterion);
  const MeanRequest request{.features = numbers(features),
                            .weights = numbers(weights),
                            .covariances = numbers(covariances),
                            .covariances_at_measurement = covariances_at_measurement,
                            .likelihood = likelihood,
                            .certify = certify,
                            .budget = budget,
                            .threads = threads};
  MeanAnswer answer;
  {
    const py::gil_scoped_release released;
    SignalWatch signals;
    answer = function(request, signals);
  }
  return answerOf(answer);
}

/// Fuses groups of n features: features (g, n, p), covariances (g, n, k, k). Returns means (g, p), covariances (g, k, k).
py::tuple fuse(const std::string& type, const DoubleArray& features, const DoubleArray& covariances,
               bool covariances_at_measurement) {
  const MeanType& means = typeOf(type);
  const py::ssize_t groups = features.shape(0), p = features.shape(2), k = covariances.shape(3);
  DoubleArray mean({groups, p});
  DoubleArray covariance({groups, k, k});
  const auto of_group = [&](const DoubleArray& array, py::ssize_t i) {
    const std::span<const double> all = numbers(array);
    const std::size_t size = all.size() / static_cast<std::size_t>(groups);
    return all.subspan(static_cast<std::size_t>(i) * size, size);
  };
  double* const mean_out = mean.mutable_data();
  double* const covariance_out = covariance.mutable_data();
  {
    const py::gil_scoped_release released;
    SignalWatch signals;
    for (py::ssize_t i = 0; i < groups; ++i) {
      MeanRequest request;
      request.features = of_group(features, i);
      request.covariances = of_group(covariances, i);
      request.covariances_at_measurement = covariances_at_measurement;
      means.fuse(request, mean_out + i * p, covariance_out + i * k * k);
      signals.look();
    }
  }
  return py::make_tuple(mean, covariance);
}

}  // namespace

void bindMeans(py::module_& module) {
  using namespace py::literals;
  module.def("mean", &mean, "type"_a, "criterion"_a, "features"_a, "weights"_a, "covariances"_a,
             "covariances_at_measurement"_a, "likelihood"_a, "certify"_a, "budget"_a, "threads"_a);
  module.def("fuse", &fuse, "type"_a, "features"_a, "covariances"_a, "covariances_at_measurement"_a);
}

}  // namespace liestat::python
