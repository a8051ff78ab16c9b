// Conversion of the covariances of trajectories, and the diagnosis of their convention, for Python.
#include <fusion/convention_diagnosis.hpp>
#include <fusion/evaluate.hpp>
#include <fusion/trajectory_conversion.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/described.hpp>
#include <python/src/interruptible.hpp>

#include <pybind11/stl.h>

#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace liestat::python {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;

std::vector<SE3d> posesOf(const DoubleArray& array) {
  std::vector<SE3d> poses;
  for (py::ssize_t i = 0; i < array.shape(0); ++i) poses.push_back(point<SE3d>(array.data() + 7 * i));
  return poses;
}
std::vector<Matrix6> matricesOf(const DoubleArray& array) {
  std::vector<Matrix6> matrices;
  for (py::ssize_t i = 0; i < array.shape(0); ++i) matrices.push_back(square<6>(array.data() + 36 * i));
  return matrices;
}
std::vector<double> valuesOf(const DoubleArray& array) { return {array.data(), array.data() + array.size()}; }

/// The verdict beside the fields: its sentence, and True, False or None.
py::dict withVerdict(py::dict d, const Verdict& verdict) {
  d["sentence"] = text(verdict.text);
  d["decided"] = DictView::of(verdict.decided());
  return d;
}

Convention conventionNamed(const std::string& name) {
  const std::optional<Convention> convention = parseConvention(name);
  if (!convention) throw std::invalid_argument("there is no convention '" + name + "' (docs/which_convention.md)");
  return *convention;
}

py::dict convert(const DoubleArray& poses, const DoubleArray& matrices, const std::string& from, const std::string& to,
                 bool assume_uncorrelated, bool sampled, int samples, std::uint64_t seed,
                 const std::vector<std::size_t>& lines) {
  const ConversionOptions options{assume_uncorrelated, sampled, samples, seed, lines};
  const TrajectoryConversion c = [&, T = posesOf(poses), M = matricesOf(matrices), a = conventionNamed(from),
                                  b = conventionNamed(to)] {
    const py::gil_scoped_release released;
    return interruptible([=](const std::atomic<bool>&) { return convertTrajectory(T, M, a, b, options); });
  }();
  return withVerdict(dictWithSeries(c), c.verdict());
}

/// Poses with a partner in the truth: their rows, and the truth at their times.
py::tuple matchTruth(const DoubleArray& truth, const DoubleArray& truth_times, const DoubleArray& times, bool nearest,
                     bool slerp, std::optional<double> max_gap, double max_difference, double offset) {
  const std::vector<double> at = valuesOf(truth_times), wanted = valuesOf(times);
  const AssociationOptions how{.rule = nearest ? AssociationRule::nearest : AssociationRule::interpolate,
                               .interpolation = slerp ? PoseInterpolation::slerp : PoseInterpolation::geodesic,
                               .max_gap = max_gap,
                               .max_difference = max_difference,
                               .offset = offset};
  const Associated found = associate({at, at.size(), "the truth"}, {wanted, wanted.size(), "the estimate"}, how);
  if (!found.ok()) throw std::invalid_argument("diagnose_conventions: " + found.reason);
  const std::vector<TimeMatch>& matches = found.matches;
  const std::vector<Gaussian<SE3d>> exact = exactPoses(posesOf(truth));
  const std::vector<Gaussian<SE3d>> estimate(wanted.size());
  const auto matched = matchedPoses(matches, exact, estimate, how.interpolation);
  const auto n = static_cast<py::ssize_t>(matched.size());
  py::array_t<py::ssize_t> rows(n);
  DoubleArray poses({n, py::ssize_t{7}});
  for (py::ssize_t i = 0; i < n; ++i) {
    const auto k = static_cast<std::size_t>(i);
    rows.mutable_data()[i] = static_cast<py::ssize_t>(matches[k].estimate);
    storePoint(matched[k].reference.mean, poses.mutable_data() + 7 * i);
  }
  return py::make_tuple(rows, poses);
}

template <class Enum>
Enum named(const std::string& word, std::initializer_list<Enum> values) {
  for (const Enum value : values) {
    if (word == name(value)) return value;
  }
  throw std::invalid_argument("there is no '" + word + "'");
}

/// Runs are tuples (estimates, matrices, truth, times or None); without a truth it is the estimate.
py::dict diagnose(
    const std::vector<std::tuple<DoubleArray, DoubleArray, DoubleArray, std::optional<DoubleArray>>>& given,
    const std::string& mode, const std::string& alignment, double alpha, std::optional<double> at, bool all_units,
    const std::optional<std::string>& order, const std::optional<std::string>& content, bool edges) {
  std::vector<DiagnosedRun> runs;
  for (const auto& [estimates, matrices, truth, times] : given) {
    const std::vector<SE3d> T = posesOf(estimates), exact = posesOf(truth);
    const std::vector<Matrix6> M = matricesOf(matrices);
    DiagnosedRun run;
    for (std::size_t i = 0; i < T.size(); ++i) run.poses.push_back({T[i], M[i], exact[i]});
    if (times) run.times = valuesOf(*times);
    runs.push_back(std::move(run));
  }
  CovarianceDiagnosisOptions options;
  options.mode = named(mode, {DiagnosisMode::diagnosis, DiagnosisMode::chain, DiagnosisMode::plan});
  options.alignment =
      named(alignment, {AlignmentModel::none, AlignmentModel::posyaw, AlignmentModel::se3, AlignmentModel::sim3});
  options.alpha = alpha, options.at = at, options.all_units = all_units, options.edges = edges;
  Convention fixed;
  if (order && setConventionField(fixed, "order", *order)) options.order = fixed.order;
  if (content && setConventionField(fixed, "content", *content)) options.content = fixed.content;
  const CovarianceDiagnosis d = [&] {
    const py::gil_scoped_release released;
    return interruptible([=](const std::atomic<bool>&) { return diagnoseCovariances(runs, options); });
  }();
  return withVerdict(dictOf(d), d.verdict());
}

}  // namespace

void bindConversions(py::module_& module) {
  module.def("convert_trajectory", &convert);
  module.def("match_truth", &matchTruth);
  module.def("diagnose_conventions", &diagnose);
}

}  // namespace liestat::python
