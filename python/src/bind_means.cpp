// Means for Python: arrays in, a dictionary of what is known out.
#include <python/src/binding.hpp>
#include <python/src/described.hpp>
#include <python/src/means.hpp>
#include <stats/mean_notes.hpp>
#include <stats/split_validation_types.hpp>

#include <cstdint>
#include <string>
#include <vector>

namespace liestat::python {
namespace {

const MeanType& typeOf(const std::string& name) {
  for (const auto find : {commonMeans, planarMeans, extendedPoseMeans, crystalMeans}) {
    if (const MeanType* type = find(name)) return *type;
  }
  throw py::type_error("no means of " + name);
}

/// The fields of a mean, and beside them, under "_values", what the module makes its types of.
py::dict answerOf(const MeanSummary& mean) {
  py::dict values;
  const auto p = static_cast<py::ssize_t>(mean.mean.parameters.size());
  const auto rows = [&](const auto& list, const auto& valueOf) {
    std::vector<double> all;
    for (const auto& element : list) {
      const Eigen::VectorXd& parameters = valueOf(element).parameters;
      all.insert(all.end(), parameters.begin(), parameters.end());
    }
    return arrayOf(all, {static_cast<py::ssize_t>(list.size()), p});
  };
  std::vector<double> z;
  for (const NearRival& tie : mean.near_ties) z.push_back(tie.z);
  values["mean"] = DictView::of(mean.mean.parameters);
  values["rivals"] = rows(mean.rivals, [](const FeatureValue& x) -> const FeatureValue& { return x; });
  values["near_ties"] = rows(mean.near_ties, [](const NearRival& x) -> const FeatureValue& { return x.feature; });
  values["near_tie_z"] = arrayOf(z, {static_cast<py::ssize_t>(z.size())});
  values["cost"] = mean.cost;
  values["law_samples"] = mean.known_noise ? std::size_t{0} : static_cast<std::size_t>(mean.law_n);
  py::dict d = dictOf(mean);
  d["_values"] = values;
  return d;
}

/// The name of the rotations of a point group or Laue class, None for an unknown name.
py::object pointGroup(const std::string& name, bool x_along_a) {
  const auto group = PointGroup::fromName(name, x_along_a ? HexagonalAxes::x_along_a : HexagonalAxes::x_along_a_star);
  return group ? py::object(text(std::string(group->name()))) : py::none();
}

Criterion criterionOf(const std::string& text) {
  for (const Criterion c :
       {Criterion::lsq, Criterion::wlsq, Criterion::maha, Criterion::barycentre, Criterion::huber, Criterion::median}) {
    if (name(c) == text) return c;
  }
  throw py::value_error("no criterion " + text);
}

MeanRequest requestOf(const std::string& criterion, const DoubleArray& features, const DoubleArray& weights,
                      const DoubleArray& covariances, bool factored, const DoubleArray& times,
                      bool covariances_at_measurement, bool likelihood, int threads) {
  return {.criterion = criterionOf(criterion),
          .features = numbers(features),
          .weights = numbers(weights),
          .covariances = numbers(covariances),
          .factored = factored,
          .times = numbers(times),
          .covariance_at = covariances_at_measurement ? CovarianceAt::measured : CovarianceAt::estimated,
          .likelihood = likelihood,
          .threads = threads};
}

py::dict mean(const std::string& type, const std::string& criterion, const DoubleArray& features,
              const DoubleArray& weights, const DoubleArray& covariances, bool factored, const DoubleArray& times,
              bool covariances_at_measurement, bool likelihood, bool residuals_if_refuted, bool birge,
              const std::string& weights_are, bool bootstrap, bool certify, bool inflate, std::size_t budget,
              int threads, const std::string& symmetry) {
  const MeanType& means = typeOf(type);
  MeanRequest request = requestOf(criterion, features, weights, covariances, factored, times,
                                  covariances_at_measurement, likelihood, threads);
  request.refuted_noise = residuals_if_refuted ? RefutedNoise::residuals : RefutedNoise::withheld;
  request.birge = birge;
  for (const ResidualNoise meaning : {ResidualNoise::importance, ResidualNoise::frequency}) {
    if (weights_are == name(meaning)) request.weights_are = meaning;
  }
  request.region = bootstrap ? MeanRegion::bootstrap : MeanRegion::law;
  request.certify = certify;
  request.symmetry = PointGroup::fromName(symmetry).value_or(PointGroup());
  request.inflate = inflate;
  request.budget = budget;
  MeanSummary answer;
  {
    const py::gil_scoped_release released;
    SignalWatch signals;
    answer = means.mean(request, signals);
    answer.feature = means.feature;
    const std::size_t n = request.features.size() / static_cast<std::size_t>(means.parameters);
    addMeanNotes(answer, n);
  }
  return answerOf(answer);
}

/// The validation of a mean by splits, and its verdict in words.
py::dict split(const std::string& type, const std::string& criterion, const DoubleArray& features,
               const DoubleArray& weights, const DoubleArray& covariances, bool factored, const DoubleArray& times,
               bool covariances_at_measurement, bool likelihood, std::size_t splits, std::size_t blocks,
               std::uint64_t seed, int threads) {
  const MeanType& means = typeOf(type);
  const MeanRequest request = requestOf(criterion, features, weights, covariances, factored, times,
                                        covariances_at_measurement, likelihood, threads);
  const SplitOptions options{.splits = splits, .blocks = blocks, .seed = seed};
  const std::size_t n = request.features.size() / static_cast<std::size_t>(means.parameters);
  const std::size_t fewest = fewestMeasurements(means.dof, !request.covariances.empty(), options);
  if (n < fewest) {
    throw py::value_error("validate_split: " + std::to_string(n) + " measurements, too few to be split: " +
                          std::to_string(fewest) + " at least (blocks is " + std::to_string(blocks) + ")");
  }
  SplitSummary result;
  {
    const py::gil_scoped_release released;
    SignalWatch signals;
    result = means.split(request, signals, options);
    result.feature = means.feature;
  }
  const Verdict verdict = result.verdict();
  py::dict d = dictOf(result);
  d["verdict"] = text(verdict.text);
  d["causes"] = DictView::of(verdict.causes);
  return d;
}

/// Fuses groups of n features: features (g, n, p), covariances or their factors (g, n, k, k). Returns means (g, p),
/// covariances and, of factors, their factors (g, k, k), the names of statuses, χ² and its p (g each).
py::tuple fuse(const std::string& type, const DoubleArray& features, const DoubleArray& covariances, bool factored,
               bool covariances_at_measurement) {
  const MeanType& means = typeOf(type);
  const py::ssize_t groups = features.shape(0), p = features.shape(2), k = covariances.shape(3);
  DoubleArray mean({groups, p});
  DoubleArray covariance({groups, k, k}), factor({factored ? groups : 0, k, k});
  std::vector<TestedFuse> tests(static_cast<std::size_t>(groups));
  const auto of_group = [&](const DoubleArray& array, py::ssize_t i) {
    const std::span<const double> all = numbers(array);
    const std::size_t size = all.size() / static_cast<std::size_t>(groups);
    return all.subspan(static_cast<std::size_t>(i) * size, size);
  };
  double* const mean_out = mean.mutable_data();
  double* const covariance_out = covariance.mutable_data();
  double* const factor_out = factor.mutable_data();
  {
    const py::gil_scoped_release released;
    SignalWatch signals;
    for (py::ssize_t i = 0; i < groups; ++i) {
      MeanRequest request;
      request.features = of_group(features, i);
      request.covariances = of_group(covariances, i);
      request.factored = factored;
      request.covariance_at = covariances_at_measurement ? CovarianceAt::measured : CovarianceAt::estimated;
      tests[static_cast<std::size_t>(i)] =
          means.fuse(request, mean_out + i * p, covariance_out + i * k * k, factor_out + (factored ? i * k * k : 0));
      signals.look();
    }
  }
  py::list statuses;
  std::vector<double> chi2, p_values;
  for (const TestedFuse& test : tests) {
    statuses.append(name(test.status));
    chi2.push_back(test.fit.chi2);
    p_values.push_back(test.fit.p);
  }
  return py::make_tuple(mean, covariance, factor, statuses, arrayOf(chi2, {groups}), arrayOf(p_values, {groups}));
}

}  // namespace

void bindMeans(py::module_& module) {
  using namespace py::literals;
  module.def("mean", &mean, "type"_a, "criterion"_a, "features"_a, "weights"_a, "covariances"_a, "factored"_a,
             "times"_a, "covariances_at_measurement"_a, "likelihood"_a, "residuals_if_refuted"_a, "birge"_a,
             "weights_are"_a, "bootstrap"_a, "certify"_a, "inflate"_a, "budget"_a, "threads"_a, "symmetry"_a = "1");
  module.def("point_group", &pointGroup, "name"_a, "x_along_a"_a);
  py::list fields;
  for (const auto& [name, value] : dictOf(MeanSummary{})) fields.append(name);
  module.attr("mean_fields") = fields;
  module.def("split", &split, "type"_a, "criterion"_a, "features"_a, "weights"_a, "covariances"_a, "factored"_a,
             "times"_a, "covariances_at_measurement"_a, "likelihood"_a, "splits"_a, "blocks"_a, "seed"_a, "threads"_a);
  module.def("fuse", &fuse, "type"_a, "features"_a, "covariances"_a, "factored"_a, "covariances_at_measurement"_a);
}

}  // namespace liestat::python
