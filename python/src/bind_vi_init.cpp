// Visual-inertial initialisation of a recording for Python.
#include <fusion/visual_inertial.hpp>
#include <fusion/visual_inertial_truth.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/described.hpp>
#include <python/src/interruptible.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace liestat::python {

std::vector<ImuSample<double>> readingsOf(const DoubleArray& rows);
ImuNoise<double> noiseOf(const DoubleArray& noise);
std::vector<GroundTruth> truthOf(const DoubleArray& rows);

namespace {

/// A window's fields, with its states in rows.
py::dict windowOf(const ComparedWindow& window) {
  py::dict d = dictWithSeries(window);
  const std::vector<SE23d> states = window.states();
  DoubleArray rows({static_cast<py::ssize_t>(states.size()), py::ssize_t{10}});
  for (std::size_t i = 0; i < states.size(); ++i) storePoint(states[i], rows.mutable_data() + 10 * i);
  d["states"] = rows;
  return d;
}

py::dict initialise(const DoubleArray& readings, const DoubleArray& noise, const DoubleArray& image_times,
                    const DoubleArray& cameras, const py::array_t<std::int64_t, py::array::c_style>& indices,
                    const DoubleArray& bearings, double window, double stride, double image_rate, bool consensus,
                    bool refinement, double stretch, double gravity, double gyroscope_sigma, double accelerometer_sigma,
                    std::uint64_t seed, const DoubleArray& truth_rows, bool calibrate_noise, bool inflate,
                    const std::string& filter_convention, double position_sigma, double heading_sigma) {
  struct Input {
    std::vector<ImuSample<double>> readings;
    VisualInertialRecording recording;
    VisualInertialOptions options;
  };
  Input input;
  input.readings = readingsOf(readings);
  input.recording.noise = noiseOf(noise);
  input.recording.image_times.assign(image_times.data(), image_times.data() + image_times.size());
  input.recording.cameras.clear();
  for (py::ssize_t i = 0; i < cameras.shape(0); ++i) {
    input.recording.cameras.push_back(point<SE3d>(cameras.data() + 7 * i));
  }
  // Rows of image, track, camera and of bearing, standard deviation.
  for (py::ssize_t i = 0; i < indices.shape(0); ++i) {
    const std::int64_t* index = indices.data() + 3 * i;
    const double* bearing = bearings.data() + 4 * i;
    input.recording.observations.push_back({static_cast<std::size_t>(index[0]), static_cast<std::size_t>(index[1]),
                                            vector<3>(bearing), bearing[3], static_cast<std::size_t>(index[2]),
                                            std::nullopt});
  }
  VisualInertialOptions& options = input.options;
  options.window = window;
  options.stride = stride;
  options.image_rate = image_rate;
  options.consensus = consensus;
  options.refinement = refinement;
  options.stretch = stretch;
  options.initialisation.gravity = gravity > 0 ? std::optional<double>(gravity) : std::nullopt;
  options.initialisation.prior.gyroscope_sigma = gyroscope_sigma;
  options.initialisation.prior.accelerometer_sigma = accelerometer_sigma;
  options.initialisation.consensus.seed = seed;
  options.calibrate_noise = calibrate_noise;
  options.inflate = inflate;
  options.filter_start.position_sigma = position_sigma;
  options.filter_start.heading_sigma = heading_sigma;
  const std::optional<FilterConvention> convention = named<FilterConvention>(filter_convention);
  if (!convention) {
    throw py::value_error("vi_init: filter_convention: no '" + filter_convention +
                          "', expected liestat, openvins, gtsam or basalt");
  }
  options.filter_start.convention = *convention;
  const std::vector<double> times = input.recording.image_times;
  const std::vector<GroundTruth> truth = truthOf(truth_rows);
  VisualInertialResult found;
  ComparedRecording result;
  {
    const py::gil_scoped_release released;
    found = interruptible([input = std::move(input)](const std::atomic<bool>& stop) mutable {
      input.recording.readings = input.readings;
      return initialiseRecording(input.recording, input.options, [&stop](std::size_t, std::size_t) {
        if (stop) throw Stopped{};
      });
    });
    if (!found.fault) {
      result =
          compareWithTruth(std::move(found), times, truth, gravity > 0 ? std::optional<double>(gravity) : std::nullopt);
    }
  }
  if (found.fault) throw py::value_error("vi_init: " + describe(found.fault));
  py::dict d = dictOf(result);
  py::list windows;
  for (const ComparedWindow& one : result.windows) windows.append(windowOf(one));
  d["windows"] = windows;
  py::list fused;
  for (std::size_t k = 0; k < result.stretches.size(); ++k) {
    py::dict one = py::list(d["fusions"])[k];
    one["window_indices"] = DictView::of(result.stretches[k].windows);
    fused.append(one);
  }
  d["fusions"] = fused;
  return d;
}

}  // namespace

void bindViInit(py::module_& module) { module.def("vi_init", &initialise); }

}  // namespace liestat::python
