// Evaluation of trajectories for Python.
#include <fusion/trajectories.hpp>
#include <lie/detail/small_matrix.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/interruptible.hpp>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace liestat::python {
namespace {

AlignmentModel modelNamed(const std::string& word) {
  for (const AlignmentModel model : {AlignmentModel::none, AlignmentModel::origin, AlignmentModel::posyaw,
                                     AlignmentModel::se3, AlignmentModel::sim3, AlignmentModel::scale}) {
    if (word == name(model)) return model;
  }
  throw std::invalid_argument("no alignment is called '" + word + "'");
}

template <class Derived>
DoubleArray arrayOfMatrix(const Eigen::MatrixBase<Derived>& m) {
  DoubleArray array({static_cast<py::ssize_t>(m.rows()), static_cast<py::ssize_t>(m.cols())});
  store(m, array.mutable_data());
  return array;
}
py::dict dictOf(const ResidualTest& test) {
  py::dict d;
  d["statistic"] = test.statistic, d["dof"] = test.dof, d["p"] = test.p;
  return d;
}
py::dict dictOf(const ErrorStatistics& s) {
  py::dict d;
  d["rmse"] = s.rmse, d["mean"] = s.mean, d["median"] = s.median, d["std"] = s.std;
  d["min"] = s.min, d["max"] = s.max, d["sse"] = s.sse;
  return d;
}
py::dict dictOf(const Alignment& a) {
  py::dict d;
  DoubleArray pose(7);
  storePoint(a.transform, pose.mutable_data());
  d["model"] = text(name(a.model)), d["ok"] = a.ok, d["fault"] = a.fault;
  d["transform"] = pose, d["scale"] = a.scale, d["covariance"] = arrayOfMatrix(a.covariance);
  d["parameters"] = a.parameters, d["condition"] = a.condition;
  return d;
}

/// Poses of one kind in memory: parameters, and covariances unless there are none.
std::vector<Gaussian<SE3d>> posesOf(const DoubleArray& poses, const py::object& covariances) {
  const auto n = static_cast<std::size_t>(poses.shape(0));
  const auto matrices = covariances.is_none() ? DoubleArray() : covariances.cast<DoubleArray>();
  std::vector<Gaussian<SE3d>> list(n);
  for (std::size_t i = 0; i < n; ++i) {
    list[i].mean = point<SE3d>(poses.data() + 7 * i);
    list[i].covariance.setZero();
    if (matrices.size() != 0) list[i].covariance = square<6>(matrices.data() + 36 * i);
  }
  return list;
}

struct Evaluation {
  std::vector<TimeMatch> matches;
  Alignment alignment, weighted;
  std::vector<double> position, rotation;
  ErrorStatistics position_statistics, rotation_statistics;
  Consistency consistency;
  std::vector<std::size_t> indefinite;  ///< matched poses whose covariance is not positive definite
};

py::dict evaluate(const DoubleArray& reference, const py::object& reference_times,
                  const py::object& reference_covariances, const DoubleArray& estimate, const py::object& times,
                  const py::object& covariances, const std::string& alignment, const std::string& verdict_alignment,
                  bool nearest, bool slerp, double max_gap, std::size_t n_to_align) {
  const auto truth = posesOf(reference, reference_covariances), poses = posesOf(estimate, covariances);
  const AlignmentModel model = modelNamed(alignment), verdict_model = modelNamed(verdict_alignment);
  const bool with_covariances = !covariances.is_none(), by_time = !times.is_none();
  std::vector<double> truth_times, pose_times;
  if (by_time) {
    const auto a = reference_times.cast<DoubleArray>(), b = times.cast<DoubleArray>();
    truth_times.assign(a.data(), a.data() + a.size()), pose_times.assign(b.data(), b.data() + b.size());
  }
  Evaluation e;
  {
    const py::gil_scoped_release released;
    e = interruptible([=](const std::atomic<bool>&) {
      Evaluation r;
      if (!by_time) {
        for (std::size_t i = 0; i < poses.size(); ++i) r.matches.push_back({i, i, 0, 0});
      } else if (nearest) {
        r.matches = associateNearest(truth_times, pose_times, max_gap);
      } else {
        r.matches = associateByInterpolation(truth_times, pose_times, max_gap);
      }
      const auto matched =
          matchedPoses(r.matches, truth, poses, slerp ? PoseInterpolation::slerp : PoseInterpolation::geodesic);
      if (matched.empty()) return r;
      r.alignment = alignUmeyama(matched, model, n_to_align);
      r.position = absoluteErrors(matched, r.alignment, PoseRelation::trans_part);
      r.rotation = absoluteErrors(matched, r.alignment, PoseRelation::angle_rad);
      r.position_statistics = errorStatistics(r.position), r.rotation_statistics = errorStatistics(r.rotation);
      if (with_covariances) {
        for (std::size_t i = 0; i < matched.size(); ++i) {
          if (!liestat::detail::Cholesky<double, 6>(matched[i].estimate.covariance).ok()) r.indefinite.push_back(i);
        }
        r.weighted = alignWeighted(matched, verdict_model, n_to_align);
        r.consistency = evaluateConsistency(matched, r.weighted);
      }
      return r;
    });
  }
  const auto n = static_cast<py::ssize_t>(e.matches.size());
  py::dict d;
  py::array_t<py::ssize_t> rows(n);
  for (py::ssize_t i = 0; i < n; ++i) {
    rows.mutable_data()[i] = static_cast<py::ssize_t>(e.matches[static_cast<std::size_t>(i)].estimate);
  }
  d["rows"] = rows;
  d["alignment"] = dictOf(e.alignment);
  d["position_errors"] = arrayOf(e.position, {n});
  d["rotation_errors"] = arrayOf(e.rotation, {n});
  d["position"] = dictOf(e.position_statistics);
  d["rotation"] = dictOf(e.rotation_statistics);
  if (!with_covariances || n == 0) {
    d["consistency"] = py::none();
    return d;
  }
  py::dict c;
  c["ok"] = e.consistency.ok, c["fault"] = e.consistency.fault, c["n"] = e.consistency.n;
  c["alignment"] = dictOf(e.weighted);
  c["joint"] = dictOf(e.consistency.joint), c["position"] = dictOf(e.consistency.position);
  c["rotation"] = dictOf(e.consistency.rotation);
  py::dict tests;
  const char* const names[] = {"joint", "position", "rotation", "mean", "covariance", "tail", "lag"};
  const auto all = e.consistency.tests.all();
  for (std::size_t i = 0; i < all.size(); ++i) tests[names[i]] = dictOf(all[i]);
  c["tests"] = tests;
  const auto size = static_cast<py::ssize_t>(e.consistency.errors.size());
  DoubleArray errors({size, py::ssize_t{6}}), matrices({size, py::ssize_t{6}, py::ssize_t{6}}), nees(size);
  for (py::ssize_t i = 0; i < size; ++i) {
    const PoseError& error = e.consistency.errors[static_cast<std::size_t>(i)];
    store(error.error, errors.mutable_data() + 6 * i);
    store(error.covariance, matrices.mutable_data() + 36 * i);
    nees.mutable_data()[i] = error.nees;
  }
  c["errors"] = errors, c["covariances"] = matrices, c["nees"] = nees;
  py::list indefinite;
  for (const std::size_t i : e.indefinite) indefinite.append(i);
  c["indefinite"] = indefinite;
  d["consistency"] = c;
  return d;
}

}  // namespace

void bindTrajectories(py::module_& module) { module.def("evaluate_trajectory", &evaluate); }

}  // namespace liestat::python
