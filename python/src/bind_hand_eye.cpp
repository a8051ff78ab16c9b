// Hand-eye calibration for Python.
#include <fusion/hand_eye.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/interruptible.hpp>

#include <span>
#include <vector>

namespace liestat::python {
namespace {

template <class Derived>
DoubleArray arrayOfMatrix(const Eigen::MatrixBase<Derived>& m) {
  DoubleArray array({static_cast<py::ssize_t>(m.rows()), static_cast<py::ssize_t>(m.cols())});
  store(m, array.mutable_data());
  return array;
}
DoubleArray parametersOfPose(const SE3d& x) {
  DoubleArray array(7);
  storePoint(x, array.mutable_data());
  return array;
}
DoubleArray vector6(const Eigen::Matrix<double, 6, 1>& v) {
  DoubleArray array(6);
  store(v, array.mutable_data());
  return array;
}

py::dict calibrate(const DoubleArray& a, const DoubleArray& a_covariance, const DoubleArray& b,
                   const DoubleArray& b_covariance, bool world, bool known_noise, bool find_outliers, double gate,
                   int samples, std::uint64_t seed) {
  const auto n = static_cast<std::size_t>(a.shape(0));
  std::vector<PosePair> pairs(n);
  for (std::size_t i = 0; i < n; ++i) {
    pairs[i].a = {point<SE3d>(a.data() + 7 * i), square<6>(a_covariance.data() + 36 * i)};
    pairs[i].b = {point<SE3d>(b.data() + 7 * i), square<6>(b_covariance.data() + 36 * i)};
  }
  HandEyeOptions options;
  options.known_noise = known_noise;
  options.find_outliers = find_outliers;
  options.gate = gate;
  options.samples = samples;
  options.seed = seed;
  HandEyeResult result;
  {
    const py::gil_scoped_release released;
    result = interruptible([pairs = std::move(pairs), options, world](const std::atomic<bool>&) {
      return world ? estimateRobotWorld(pairs, options) : estimateHandEye(pairs, options);
    });
  }
  py::dict d;
  d["status"] = text(name(result.status));
  d["reason"] = result.fault ? describe(result.fault) : std::string(describe(result.status));
  d["X"] = parametersOfPose(result.X.mean);
  d["X_covariance"] = arrayOfMatrix(result.X.covariance);
  d["Y"] = parametersOfPose(result.Y.mean);
  d["Y_covariance"] = arrayOfMatrix(result.Y.covariance);
  d["covariance"] = arrayOfMatrix(result.covariance);
  d["chi2"] = result.chi2;
  d["degrees_of_freedom"] = result.degrees_of_freedom;
  d["p"] = result.p;
  d["variance_factor"] = result.variance_factor;
  d["excitations"] = vector6(result.excitations);
  py::list directions;
  for (const OpenDirection& direction : result.directions) {
    py::dict one;
    one["description"] = describe(direction);
    one["excitation"] = direction.excitation;
    one["weak"] = direction.weak;
    one["twist"] = vector6(direction.twist);
    directions.append(one);
  }
  d["directions"] = directions;
  DoubleArray errors({static_cast<py::ssize_t>(result.pairs.size()), py::ssize_t{6}});
  DoubleArray distances(static_cast<py::ssize_t>(result.pairs.size()));
  for (std::size_t i = 0; i < result.pairs.size(); ++i) {
    store(result.pairs[i].error, errors.mutable_data() + 6 * i);
    distances.mutable_data()[i] = result.pairs[i].chi2;
  }
  d["errors"] = errors;
  d["pair_chi2"] = distances;
  py::list outliers;
  for (const std::size_t i : result.outliers) outliers.append(i);
  d["outliers"] = outliers;
  d["rival"] = result.rival ? py::object(parametersOfPose(*result.rival)) : py::object(py::none());
  return d;
}

}  // namespace

void bindHandEye(py::module_& module) { module.def("hand_eye", &calibrate); }

}  // namespace liestat::python
