// Evaluation of trajectories for Python.
#include <fusion/convention_diagnosis.hpp>
#include <fusion/evaluate.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/described.hpp>
#include <python/src/interruptible.hpp>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace liestat::python {
namespace {

template <Worded E>
E chosen(const char* option, const std::string& word) {
  if (const std::optional<E> choice = named<E>(word)) return *choice;
  std::string all;
  for (const char* known : words(E{})) all += (all.empty() ? "'" : ", '") + std::string(known) + "'";
  throw std::invalid_argument(std::string("evaluate_trajectory: ") + option + ": expected one of " + all + ", got '" +
                              word + "'");
}

/// Options by their names in describe(v, EvaluationOptions).
class GivenOptions {
 public:
  explicit GivenOptions(const py::dict& given) : given_(given) {}

  template <class T>
  const GivenOptions& operator()(const char* option, T& value) const {
    const py::object given = given_[option];
    try {
      if constexpr (requires { value.has_value(); }) {
        if (!given.is_none()) value = cast<typename T::value_type>(option, given);
      } else {
        value = cast<T>(option, given);
      }
    } catch (const py::cast_error&) {
      throw std::invalid_argument(std::string("evaluate_trajectory: ") + option + ": got " +
                                  py::repr(given).cast<std::string>());
    }
    return *this;
  }

 private:
  template <class T>
  static T cast(const char* option, const py::object& given) {
    if constexpr (Worded<T>) {
      return chosen<T>(option, given.cast<std::string>());
    } else {
      return given.cast<T>();
    }
  }

  const py::dict& given_;
};

EvaluationOptions optionsOf(const py::dict& given) {
  EvaluationOptions o;
  const GivenOptions take(given);
  AssociationOptions& a = o.association;
  take("association", a.rule)("interpolation", a.interpolation)("max_gap", a.max_gap)("t_max_diff", a.max_difference);
  take("t_offset", a.offset)("t_start", a.start)("t_end", a.end);
  take("pose_relation", o.pose_relation)("alignment", o.alignment)("verdict_alignment", o.verdict_alignment);
  take("n_to_align", o.n_to_align)("project_to_plane", o.project_to_plane)("change_unit", o.change_unit);
  take("downsample", o.downsample);
  std::optional<std::pair<double, double>> motion;
  take("motion_filter", motion);
  if (motion) o.motion_filter = {motion->first, motion->second};
  take("delta", o.relative.delta)("delta_unit", o.relative.unit)("delta_tol", o.relative.relative_tolerance);
  take("all_pairs", o.relative.all_pairs)("pairs_from_reference", o.relative.pairs_from_reference);
  take("pairs_model", o.pairs_model)("misfit", o.misfit);
  return o;
}

/// Arrays as a trajectory: parameters, and times and covariances unless they are None.
PoseTrajectory trajectoryOf(const DoubleArray& poses, const py::object& times, const py::object& covariances) {
  PoseTrajectory t;
  t.has_covariances = !covariances.is_none();
  t.covariance_convention = describe(Convention{});
  const auto matrices = t.has_covariances ? covariances.cast<DoubleArray>() : DoubleArray();
  if (!times.is_none()) {
    const auto stamps = times.cast<DoubleArray>();
    t.times.assign(stamps.data(), stamps.data() + stamps.size());
  }
  for (std::size_t i = 0; i < static_cast<std::size_t>(poses.shape(0)); ++i) {
    Gaussian<SE3d> pose{point<SE3d>(poses.data() + 7 * i), Eigen::Matrix<double, 6, 6>::Zero()};
    if (t.has_covariances) pose.covariance = square<6>(matrices.data() + 36 * i);
    t.poses.push_back(pose);
  }
  return t;
}

py::dict evaluate(const DoubleArray& reference, const py::object& reference_times,
                  const py::object& reference_covariances, const DoubleArray& estimate, const py::object& times,
                  const py::object& covariances, const py::dict& options) {
  const PoseTrajectory truth = trajectoryOf(reference, reference_times, reference_covariances);
  const PoseTrajectory poses = trajectoryOf(estimate, times, covariances);
  const EvaluationOptions how = optionsOf(options);
  TrajectoryEvaluation e;
  {
    const py::gil_scoped_release released;
    e = interruptible([=](const std::atomic<bool>&) { return evaluateTrajectory(truth, poses, how); });
  }
  DictView parts;
  describeSetting(parts, e), describe(parts, e), describeSeries(parts, e);
  parts("position", errorStatistics(e.position_errors))("rotation", errorStatistics(e.rotation_errors));
  DictView outcome;
  outcome("status", name(e.status))("reason", e.reason)("alignment_fault", e.alignment.fault);
  outcome("weighted_fault", e.weighted.fault)("consistency_ok", e.consistency.ok);
  outcome("consistency_fault", e.consistency.fault)("n_tested", e.consistency.n);
  py::dict result;
  result["parts"] = parts.dict, result["outcome"] = outcome.dict;
  return result;
}

}  // namespace

void bindTrajectories(py::module_& module) {
  module.def("evaluate_trajectory", &evaluate);
  module.def("evaluation_options", [] { return dictOf(EvaluationOptions{}); });
}

}  // namespace liestat::python
