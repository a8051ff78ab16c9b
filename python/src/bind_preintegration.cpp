// Preintegration of many intervals of one recording for Python.
#include <fusion/imu/recording_windows.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/described.hpp>
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

/// True states in rows: time, pose and velocity of SE23, biases of gyroscope and accelerometer.
std::vector<GroundTruth> truthOf(const DoubleArray& rows) {
  std::vector<GroundTruth> list(static_cast<std::size_t>(rows.shape(0)));
  const double* p = rows.data();
  for (GroundTruth& truth : list) {
    truth = {p[0], point<SE23d>(p + 1), {vector<3>(p + 11), vector<3>(p + 14)}};
    p += 17;
  }
  return list;
}

namespace {

/// `bias` has six numbers, or none: then it is that of the truth, or zero.
py::dict preintegrateAll(const DoubleArray& readings, const DoubleArray& begin, const DoubleArray& end,
                         const DoubleArray& noise, const DoubleArray& bias, const std::string& scheme, double max_gap,
                         int threads, const DoubleArray& truth_rows, double gravity, double rate,
                         const DoubleArray& world_rate) {
  RecordingWindowOptions options;
  options.integration.preintegration.noise = noiseOf(noise);
  options.integration.scheme = schemeOf(scheme);
  options.integration.max_gap = max_gap;
  if (bias.size() > 0) options.bias = {vector<3>(bias.data()), vector<3>(bias.data() + 3)};
  options.gravity = gravity;
  options.world_rate = vector<3>(world_rate.data());
  const std::vector<ImuSample<double>> list = readingsOf(readings);
  const std::vector<GroundTruth> truth = truthOf(truth_rows);
  options.integration.preintegration.rate = rate > 0 ? rate : readingRate<double>(list, max_gap);
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
  RecordingWindows result = preintegrateWindows(list, {}, truth, options);
  result.windows.resize(static_cast<std::size_t>(n));
  {
    const py::gil_scoped_release released;
    SignalWatch signals;
    const PythonExecutor executor{threads, &signals};
    const std::size_t n_chunks = chunkCount(result.windows.size(), 8);
    executor.reduce(
        n_chunks,
        [&](std::size_t chunk) {
          const ChunkRange range = chunkRange(result.windows.size(), n_chunks, chunk);
          for (std::size_t i = range.begin; i < range.end; ++i) {
            RecordingWindow& window = result.windows[i];
            window = preintegrateWindow(list, {begins[i], ends[i]}, truth, options);
            const Preintegration<double>& motion = window.result.motion;
            storePoint(motion.increment(), increments + 10 * i);
            store(motion.gaussian().covariance, covariances + 81 * i);
            store(motion.covarianceWithBias(), all_covariances + 225 * i);
            store(motion.biasJacobian(), jacobians + 54 * i);
          }
          return 0;
        },
        [](int&, const int&) {});
  }
  py::dict d = dictOf(result);
  py::list reasons;
  for (const RecordingWindow& window : result.windows) {
    reasons.append(window.ok() ? std::string() : describe(window.result.fault));
  }
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
