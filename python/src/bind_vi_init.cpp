// Visual-inertial initialisation of a recording for Python.
#include <fusion/visual_inertial.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/binding.hpp>
#include <python/src/interruptible.hpp>

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace liestat::python {

std::vector<ImuSample<double>> readingsOf(const DoubleArray& rows);
ImuNoise<double> noiseOf(const DoubleArray& noise);

namespace {

DoubleArray vector3(const Eigen::Vector3d& v) {
  DoubleArray array(3);
  store(v, array.mutable_data());
  return array;
}

/// A window's result in plain numbers.
py::dict windowOf(const InitialisedWindow& window) {
  py::dict d;
  d["begin"] = window.begin;
  d["end"] = window.end;
  d["status"] = text(name(window.verdict()));
  d["reason"] = window.fault ? describe(window.fault) : std::string(describe(window.verdict()));
  const std::vector<SE23d> states = window.states();
  DoubleArray rows({static_cast<py::ssize_t>(states.size()), py::ssize_t{10}});
  for (std::size_t i = 0; i < states.size(); ++i) storePoint(states[i], rows.mutable_data() + 10 * i);
  d["states"] = rows;
  const ImuBias<double> bias = window.bias();
  d["gyroscope_bias"] = vector3(bias.gyroscope);
  d["accelerometer_bias"] = vector3(bias.accelerometer);
  const bool refined = window.isRefined();
  d["refined"] = refined;
  const auto& closed = window.closedForm();
  if (refined) {
    d["velocity"] = vector3(window.refined->velocity());
    d["gravity"] = vector3(window.refined->gravity);
    DoubleArray joint({py::ssize_t{27}, py::ssize_t{27}});
    store(window.refined->covariance.joint, joint.mutable_data());
    d["covariance"] = joint;
    d["scale_sigma"] = window.refined->scale_sigma;
    d["tilt_sigma"] = window.refined->tilt_sigma;
    d["chi2"] = window.refined->cost;
    d["degrees_of_freedom"] = window.refined->degrees_of_freedom;
  } else {
    const bool any = !closed.solutions.empty();
    d["velocity"] = any ? py::object(vector3(closed.solutions[0].velocity)) : py::object(py::none());
    d["gravity"] = any ? py::object(vector3(closed.solutions[0].gravity)) : py::object(py::none());
    d["covariance"] = py::none();
    d["scale_sigma"] = closed.scale_sigma;
    d["tilt_sigma"] = closed.tilt_sigma;
    d["chi2"] = any ? closed.solutions[0].cost : std::nan("");
    d["degrees_of_freedom"] = closed.degrees_of_freedom;
  }
  py::list images, tracks, inliers;
  for (const std::size_t i : window.images) images.append(i);
  for (const std::size_t i : window.tracks) tracks.append(i);
  for (const std::size_t i : window.found.inliers) inliers.append(window.tracks[i]);
  d["images"] = images;
  d["tracks"] = tracks;
  d["inliers"] = inliers;
  return d;
}

py::dict initialise(const DoubleArray& readings, const DoubleArray& noise, const DoubleArray& image_times,
                    const DoubleArray& cameras, const py::array_t<std::int64_t, py::array::c_style>& indices,
                    const DoubleArray& bearings, double window, double stride, double image_rate, bool consensus,
                    bool refinement, double stretch, double gravity, double gyroscope_sigma, double accelerometer_sigma,
                    std::uint64_t seed) {
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
  VisualInertialResult result;
  {
    const py::gil_scoped_release released;
    result = interruptible([input = std::move(input)](const std::atomic<bool>& stop) mutable {
      input.recording.readings = input.readings;
      return initialiseRecording(input.recording, input.options, [&stop](std::size_t, std::size_t) {
        if (stop) throw Stopped{};
      });
    });
  }
  py::dict d;
  d["fault"] = result.fault ? describe(result.fault) : std::string();
  py::list windows;
  for (const InitialisedWindow& one : result.windows) windows.append(windowOf(one));
  d["windows"] = windows;
  py::list stretches;
  for (const FusedStretch& stretch_found : result.stretches) {
    py::dict one;
    one["begin"] = stretch_found.begin;
    one["end"] = stretch_found.end;
    one["ok"] = stretch_found.ok();
    one["p"] = stretch_found.p;
    one["inflation"] = stretch_found.inflation;
    one["chi2"] = stretch_found.chi2;
    one["degrees_of_freedom"] = stretch_found.degrees_of_freedom;
    py::list of_windows;
    for (const std::size_t i : stretch_found.windows) of_windows.append(i);
    one["windows"] = of_windows;
    stretches.append(one);
  }
  d["stretches"] = stretches;
  d["images_outside"] = result.images_outside;
  return d;
}

}  // namespace

void bindViInit(py::module_& module) { module.def("vi_init", &initialise); }

}  // namespace liestat::python
