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

template <class Enum>
Enum named(const std::string& word, std::initializer_list<Enum> values) {
  for (const Enum value : values) {
    if (word == name(value)) return value;
  }
  throw std::invalid_argument("there is no '" + word + "'");
}

PoseTrajectory trajectoryOf(const DoubleArray& poses, const std::optional<DoubleArray>& times) {
  return {.times = times ? valuesOf(*times) : std::vector<double>(), .poses = exactPoses(posesOf(poses))};
}

/// A run of poses with their matrices, and times or None.
using GivenRun = std::tuple<DoubleArray, DoubleArray, std::optional<DoubleArray>>;

/// Without a truth a run has none, and with one that has no times row i belongs to row i.
DiagnosedRun runOf(const GivenRun& given, const std::optional<PoseTrajectory>& truth, const AssociationOptions& how) {
  const auto& [poses, matrices, times] = given;
  PoseTrajectory estimate = trajectoryOf(poses, times);
  const std::vector<Matrix6> all = matricesOf(matrices);
  for (std::size_t i = 0; i < all.size(); ++i) estimate.poses.setCovariance(i, all[i]);
  if (!truth) {
    DiagnosedRun run{{}, estimate.times};
    for (const Gaussian<SE3d>& pose : estimate.poses) run.poses.push_back({pose.mean, pose.covariance, pose.mean});
    return run;
  }
  const std::vector<double> stamps = estimate.times;
  if (truth->times.empty()) estimate.times.clear();
  RunAgainstTruth found = runAgainstTruth(*truth, estimate, how);
  if (!found.ok()) throw std::invalid_argument("diagnose_conventions: " + found.reason);
  if (truth->times.empty()) found.run.times = stamps;
  return found.run;
}

AssociationOptions associationOf(const py::dict& given) {
  return {.rule = *liestat::named<AssociationRule>(given["association"].cast<std::string>()),
          .interpolation = *liestat::named<PoseInterpolation>(given["interpolation"].cast<std::string>()),
          .max_gap = given["max_gap"].cast<std::optional<double>>(),
          .max_difference = given["max_difference"].cast<double>(),
          .offset = given["offset"].cast<double>(),
          .start = given["start"].cast<std::optional<double>>(),
          .end = given["end"].cast<std::optional<double>>()};
}

py::dict diagnose(const std::vector<GivenRun>& given, const std::optional<DoubleArray>& true_poses,
                  const std::optional<DoubleArray>& truth_times, const py::dict& association, const std::string& mode,
                  const std::string& alignment, double alpha, std::optional<double> at, bool all_units,
                  const std::optional<std::string>& order, const std::optional<std::string>& content, bool edges,
                  bool misfit) {
  std::optional<PoseTrajectory> truth;
  if (true_poses) truth = trajectoryOf(*true_poses, truth_times);
  const AssociationOptions how = associationOf(association);
  std::vector<DiagnosedRun> runs;
  for (const GivenRun& run : given) runs.push_back(runOf(run, truth, how));
  CovarianceDiagnosisOptions options;
  options.mode = named(mode, {DiagnosisMode::diagnosis, DiagnosisMode::chain, DiagnosisMode::plan});
  options.alignment =
      named(alignment, {AlignmentModel::none, AlignmentModel::posyaw, AlignmentModel::se3, AlignmentModel::sim3});
  options.alpha = alpha, options.at = at, options.all_units = all_units, options.edges = edges, options.misfit = misfit;
  Convention fixed;
  if (order && setConventionField(fixed, "order", *order)) options.order = fixed.order;
  if (content && setConventionField(fixed, "content", *content)) options.content = fixed.content;
  const CovarianceDiagnosis d = [&] {
    const py::gil_scoped_release released;
    return interruptible([=](const std::atomic<bool>&) { return diagnoseCovariances(runs, options); });
  }();
  return dictOf(d);
}

}  // namespace

void bindConversions(py::module_& module) {
  module.def("convert_trajectory", &convert);
  module.def("diagnose_conventions", &diagnose);
}

}  // namespace liestat::python
