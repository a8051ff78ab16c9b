// The program's readers of files for Python: columns by name.
#include <formats/image_tracks.hpp>
#include <formats/imu.hpp>
#include <formats/input_error.hpp>
#include <formats/features.hpp>
#include <python/src/binding.hpp>

#include <pybind11/stl.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <string>
#include <vector>

namespace liestat::python {
namespace {

template <class List, class Write>
DoubleArray rowsOf(const List& list, py::ssize_t columns, Write write) {
  DoubleArray rows({static_cast<py::ssize_t>(list.size()), columns});
  double* out = rows.mutable_data();
  for (const auto& row : list) {
    write(row, out);
    out += columns;
  }
  return rows;
}
py::array_t<std::int64_t> integers(const std::vector<std::int64_t>& list) {
  py::array_t<std::int64_t> array(static_cast<py::ssize_t>(list.size()));
  std::copy(list.begin(), list.end(), array.mutable_data());
  return array;
}

py::dict readFeatures(const std::string& path, const std::string& format, double norm_tolerance,
                      const std::string& angles, bool ignore_unknown, const std::vector<std::string>& columns) {
  ReadingOptions options;
  options.format = format;
  options.norm_tolerance = norm_tolerance;
  options.angles = angles == "radians"   ? AngleUnit::radians
                   : angles == "degrees" ? AngleUnit::degrees
                                         : AngleUnit::unsaid;
  options.ignore_unknown = ignore_unknown;
  options.columns = columns;
  const FeatureFile file = [&] {
    const py::gil_scoped_release released;
    return readFeatureFile(path, options);
  }();
  const auto vector3 = [](const Eigen::Vector3d& v, double* out) { Eigen::Map<Eigen::Vector3d>{out} = v; };
  py::dict d;
  d["kind"] = experiments::name(file.kind);
  d["format"] = file.format;
  d["rotations"] = rowsOf(file.rotations, 4, [](const Eigen::Quaterniond& q, double* out) {
    Eigen::Map<Eigen::Vector4d>{out} = q.coeffs();
  });
  d["positions"] = rowsOf(file.positions, 3, vector3);
  d["directions"] = rowsOf(file.directions, 3, vector3);
  d["weights"] = arrayOf(file.weights, {static_cast<py::ssize_t>(file.weights.size())});
  d["times"] = arrayOf(file.times, {static_cast<py::ssize_t>(file.times.size())});
  d["lines"] = integers(std::vector<std::int64_t>(file.lines.begin(), file.lines.end()));
  const py::ssize_t k = file.covariances.empty() ? 0 : static_cast<py::ssize_t>(file.covariances[0].rows());
  DoubleArray covariances({static_cast<py::ssize_t>(file.covariances.size()), k, k});
  double* out = covariances.mutable_data();
  for (const FeatureCovariance& covariance : file.covariances) {
    for (py::ssize_t i = 0; i < k; ++i) {
      for (py::ssize_t j = 0; j < k; ++j) *out++ = covariance(i, j);
    }
  }
  d["covariances"] = covariances;
  return d;
}

py::dict readImuFile(const std::string& path) {
  const ImuFile file = [&] {
    const py::gil_scoped_release released;
    return readImu(path);
  }();
  py::dict d;
  d["format"] = file.format;
  d["start_ns"] = file.start_ns;
  d["readings"] = rowsOf(file.samples, 7, [](const ImuSample<double>& sample, double* out) {
    out[0] = sample.time;
    Eigen::Map<Eigen::Vector3d>{out + 1} = sample.angular_rate;
    Eigen::Map<Eigen::Vector3d>{out + 4} = sample.specific_force;
  });
  return d;
}

py::dict readTracksFile(const std::string& path, const std::string& image_times, std::int64_t start_ns) {
  const ImageTracks file = [&] {
    const py::gil_scoped_release released;
    return readImageTracks(path, image_times, start_ns);
  }();
  std::vector<std::int64_t> images, tracks;
  for (const auto& seen : file.observations) {
    images.push_back(static_cast<std::int64_t>(seen.image));
    tracks.push_back(static_cast<std::int64_t>(seen.track));
  }
  py::dict d;
  d["format"] = file.format;
  d["image_times"] = arrayOf(file.times, {static_cast<py::ssize_t>(file.times.size())});
  d["frames"] = integers(std::vector<std::int64_t>(file.frames.begin(), file.frames.end()));
  d["track_ids"] = integers(std::vector<std::int64_t>(file.track_ids.begin(), file.track_ids.end()));
  d["images"] = integers(images);
  d["tracks"] = integers(tracks);
  d["pixels"] = rowsOf(file.observations, 2, [](const auto& seen, double* out) {
    out[0] = seen.u;
    out[1] = seen.v;
  });
  return d;
}

}  // namespace

void bindReaders(py::module_& module) {
  static py::exception<InputError> input_error(module, "InputError", PyExc_ValueError);
  module.def("read_features", &readFeatures);
  module.def("read_imu", &readImuFile);
  module.def("read_tracks", &readTracksFile);
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const InputError& error) {
      input_error(error.what());
    }
  });
}

}  // namespace liestat::python
