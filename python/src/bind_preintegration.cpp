// Preintegration of many intervals of one recording for Python.
#include <fusion/imu/preintegrate.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/executor.hpp>

#include <array>
#include <string>
#include <vector>

namespace liestat::python {
namespace {

ImuScheme schemeOf(const std::string& name) {
  if (name == "averaged") return ImuScheme::averaged;
  if (name == "held") return ImuScheme::held;
  if (name == "cubic") return ImuScheme::cubic;
  throw py::value_error("scheme: expected 'averaged', 'held' or 'cubic'");
}

}  // namespace

/// Readings in rows: time, rate, force.
std::vector<ImuSample<double>> readingsOf(const DoubleArray& rows) {
  std::vector<ImuSample<double>> list(static_cast<std::size_t>(rows.shape(0)));
  const double* p = rows.data();
  for (ImuSample<double>& sample : list) {
    sample = {p[0], vector<3>(p + 1), vector<3>(p + 4)};
    p += 7;
  }
  return list;
}
/// Noise densities: gyroscope, accelerometer, their walks.
ImuNoise<double> noiseOf(const DoubleArray& noise) {
  const double* p = noise.data();
  return {p[0], p[1], p[2], p[3]};
}

namespace {

py::dict preintegrateAll(const DoubleArray& readings, const DoubleArray& begin, const DoubleArray& end,
                         const DoubleArray& noise, const DoubleArray& bias, const std::string& scheme, double max_gap,
                         int threads) {
  RecordingOptions<double> options;
  options.preintegration.noise = noiseOf(noise);
  options.preintegration.bias = {vector<3>(bias.data()), vector<3>(bias.data() + 3)};
  options.scheme = schemeOf(scheme);
  options.max_gap = max_gap;
  const std::vector<ImuSample<double>> list = readingsOf(readings);
  const auto n = begin.size();
  DoubleArray increment({n, py::ssize_t{10}});
  DoubleArray covariance({n, py::ssize_t{9}, py::ssize_t{9}});
  DoubleArray with_bias({n, py::ssize_t{15}, py::ssize_t{15}});
  DoubleArray jacobian({n, py::ssize_t{9}, py::ssize_t{6}});
  double* const increments = increment.mutable_data();
  double* const covariances = covariance.mutable_data();
  double* const all_covariances = with_bias.mutable_data();
  double* const jacobians = jacobian.mutable_data();
  const double* const begins = begin.data();
  const double* const ends = end.data();
  std::vector<Fault> faults(static_cast<std::size_t>(n));
  {
    const py::gil_scoped_release released;
    SignalWatch signals;
    const PythonExecutor executor{threads, &signals};
    const std::size_t n_chunks = chunkCount(faults.size(), 8);
    executor.reduce(
        n_chunks,
        [&](std::size_t chunk) {
          const ChunkRange range = chunkRange(faults.size(), n_chunks, chunk);
          for (std::size_t i = range.begin; i < range.end; ++i) {
            const RecordingResult<double> result =
                preintegrate<double>(std::span<const ImuSample<double>>(list), begins[i], ends[i], options);
            faults[i] = result.fault;
            storePoint(result.motion.increment(), increments + 10 * i);
            store(result.motion.gaussian().covariance, covariances + 81 * i);
            store(result.motion.covarianceWithBias(), all_covariances + 225 * i);
            store(result.motion.biasJacobian(), jacobians + 54 * i);
          }
          return 0;
        },
        [](int&, const int&) {});
  }
  py::list reasons;
  for (const Fault& fault : faults) reasons.append(fault ? describe(fault) : std::string());
  py::dict d;
  d["increment"] = increment;
  d["covariance"] = covariance;
  d["covariance_with_bias"] = with_bias;
  d["bias_jacobian"] = jacobian;
  d["faults"] = reasons;
  return d;
}

}  // namespace

void bindPreintegration(py::module_& module) { module.def("preintegrate", &preintegrateAll); }

}  // namespace liestat::python
