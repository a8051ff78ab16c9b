// The readers of formats/ for Python, but for those of trajectories: columns by name.
#include <formats/calibration.hpp>
#include <formats/features.hpp>
#include <formats/images.hpp>
#include <formats/recording.hpp>
#include <formats/imu.hpp>
#include <formats/input_error.hpp>
#include <formats/pose_pairs.hpp>
#include <formats/tracks.hpp>
#include <formats/two_view_pairs.hpp>
#include <fusion/tracking/tracker.hpp>
#include <python/src/array_operations.hpp>
#include <python/src/described.hpp>

#include <pybind11/stl.h>

#include <algorithm>
#include <cstdint>
#include <exception>
#include <memory>
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
/// Calls a reader without the interpreter's lock, so that other threads of Python run meanwhile.
template <class Reader>
auto released(Reader&& reader) {
  const py::gil_scoped_release release;
  return reader();
}
template <class M>
DoubleArray arrayOfPoints(const std::vector<M>& points) {
  return rowsOf(points, parametersOf<M>(), [](const M& x, double* out) { storePoint(x, out); });
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
  const FeatureFile file = released([&] { return readFeatureFile(path, options); });
  const auto vector3 = [](const Eigen::Vector3d& v, double* out) { Eigen::Map<Eigen::Vector3d>{out} = v; };
  py::dict d;
  d["kind"] = liestat::name(file.kind);
  d["format"] = file.format;
  d["rotations"] = rowsOf(file.rotations, 4, [](const Eigen::Quaterniond& q, double* out) {
    Eigen::Map<Eigen::Vector4d>{out} = q.coeffs();
  });
  d["positions"] = rowsOf(file.positions, 3, vector3);
  d["directions"] = rowsOf(file.directions, 3, vector3);
  d["headings"] = rowsOf(file.headings, 2, [](double degrees, double* out) { liestat_heading(degrees, out); });
  d["weights"] = python::arrayOf(file.weights, {static_cast<py::ssize_t>(file.weights.size())});
  d["times"] = python::arrayOf(file.times, {static_cast<py::ssize_t>(file.times.size())});
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
  const ImuFile file = released([&] { return readImu(path); });
  py::dict d;
  d["format"] = file.format;
  d["start_ns"] = file.start_ns;
  d["notes"] = file.notes;
  d["readings"] = rowsOf(file.samples, 7, [](const ImuSample<double>& sample, double* out) {
    out[0] = sample.time;
    Eigen::Map<Eigen::Vector3d>{out + 1} = sample.angular_rate;
    Eigen::Map<Eigen::Vector3d>{out + 4} = sample.specific_force;
  });
  return d;
}

template <class List>
DoubleArray sigmasOf(const List& list) {
  std::vector<double> sigmas;
  for (const auto& seen : list) sigmas.push_back(seen.sigma);
  return python::arrayOf(sigmas, {static_cast<py::ssize_t>(sigmas.size())});
}

py::dict readTracksFile(const std::string& path, const std::string& image_times, std::int64_t start_ns) {
  const ImageTracks file = released([&] { return readImageTracks(path, image_times, start_ns); });
  std::vector<std::int64_t> images, tracks;
  for (const auto& seen : file.observations) {
    images.push_back(static_cast<std::int64_t>(seen.image));
    tracks.push_back(static_cast<std::int64_t>(seen.track));
  }
  py::dict d;
  d["format"] = file.format;
  d["image_times"] = python::arrayOf(file.times, {static_cast<py::ssize_t>(file.times.size())});
  d["frames"] = integers(std::vector<std::int64_t>(file.frames.begin(), file.frames.end()));
  d["track_ids"] = integers(std::vector<std::int64_t>(file.track_ids.begin(), file.track_ids.end()));
  d["images"] = integers(images);
  d["tracks"] = integers(tracks);
  d["pixels"] = rowsOf(file.observations, 2, [](const auto& seen, double* out) {
    out[0] = seen.u;
    out[1] = seen.v;
  });
  if (file.has_sigmas) d["sigmas"] = sigmasOf(file.observations);
  return d;
}

/// The tracks of images, in the layout of readTracksFile.
py::dict trackFiles(const std::vector<std::string>& paths, const std::string& times, std::size_t every,
                    const TrackerOptions& options) {
  std::vector<double> image_times;
  std::vector<std::int64_t> frames, images, tracks;
  const std::vector<TrackedPoint> points = released([&] {
    ImageReader reader(paths, times, every, "liestat.track");
    const std::unique_ptr<PointFlow> flow = imageLibrary("liestat.track").pointFlow();
    Tracker tracker(*flow, options);
    for (GreyView image = reader.next(); image.pixels != nullptr; image = reader.next()) {
      frames.push_back(static_cast<std::int64_t>(reader.frame()));
      image_times.push_back(reader.time());
      tracker.take(image);
    }
    return tracker.finish();
  });
  for (const TrackedPoint& p : points) {
    images.push_back(static_cast<std::int64_t>(p.image));
    tracks.push_back(static_cast<std::int64_t>(p.track));
  }
  py::dict d;
  d["image_times"] = python::arrayOf(image_times, {static_cast<py::ssize_t>(image_times.size())});
  d["frames"] = integers(frames);
  d["images"] = integers(images);
  d["tracks"] = integers(tracks);
  d["pixels"] = rowsOf(points, 2, [](const auto& seen, double* out) {
    out[0] = seen.u;
    out[1] = seen.v;
  });
  d["sigmas"] = sigmasOf(points);
  return d;
}

/// The densities in the order of preintegrate's argument `noise`.
DoubleArray arrayOf(const ImuNoise<double>& noise) {
  return python::arrayOf({noise.gyroscope, noise.accelerometer, noise.gyroscope_walk, noise.accelerometer_walk}, {4});
}

py::dict readCalibrationFiles(const std::vector<std::string>& paths) {
  const Calibration file = released([&] { return readCalibration(paths); });
  py::list cameras;
  for (const CameraCalibration& c : file.cameras) {
    py::dict d;
    d["name"] = c.name;
    d["camera"] =
        py::make_tuple(c.camera.fu, c.camera.fv, c.camera.cu, c.camera.cv, static_cast<int>(c.camera.distortion),
                       DictView::of(c.camera.coefficients), c.camera.width, c.camera.height, c.camera.mirror);
    d["imu_T_camera"] = DictView::of(c.imu_T_cam.params());
    d["timeshift"] = c.timeshift_cam_imu;
    cameras.append(d);
  }
  py::dict d;
  d["imu_noise"] = file.imu ? py::object(arrayOf(*file.imu)) : py::none();
  d["cameras"] = cameras;
  return d;
}

py::dict readGroundTruthFile(const std::string& path, std::int64_t start_ns) {
  const std::vector<GroundTruth> rows = released([&] { return readGroundTruth(path, start_ns); });
  std::vector<double> times;
  std::vector<SE23d> states;
  for (const GroundTruth& row : rows) times.push_back(row.time), states.push_back(row.state);
  py::dict d;
  d["times"] = DictView::of(times), d["states"] = arrayOfPoints(states);
  d["biases"] = rowsOf(rows, 6, [](const GroundTruth& row, double* out) {
    Eigen::Map<Eigen::Vector3d>{out} = row.bias.gyroscope;
    Eigen::Map<Eigen::Vector3d>{out + 3} = row.bias.accelerometer;
  });
  return d;
}

py::dict readStereoTracksFile(const std::string& path) {
  const std::vector<StereoObservation> rows = released([&] { return readStereoTracks(path); });
  std::vector<std::int64_t> frames, tracks;
  for (const StereoObservation& row : rows) {
    frames.push_back(static_cast<std::int64_t>(row.frame)), tracks.push_back(static_cast<std::int64_t>(row.track));
  }
  py::dict d;
  d["frames"] = integers(frames), d["tracks"] = integers(tracks);
  d["pixels"] = rowsOf(rows, 4, [](const StereoObservation& row, double* out) {
    Eigen::Map<Eigen::Vector4d>{out} = Eigen::Vector4d(row.uL, row.vL, row.uR, row.vR);
  });
  return d;
}

py::dict readCameraPosesFile(const std::string& path) {
  const std::vector<CameraPose> rows = released([&] { return readCameraPoses(path); });
  std::vector<std::int64_t> frames;
  std::vector<double> times;
  std::vector<SE3d> poses;
  for (const CameraPose& row : rows) {
    frames.push_back(static_cast<std::int64_t>(row.frame)), times.push_back(row.t);
    poses.emplace_back(SO3d(row.R_camera_world).inverse(), row.c);
  }
  py::dict d;
  d["frames"] = integers(frames), d["times"] = DictView::of(times), d["world_T_camera"] = arrayOfPoints(poses);
  return d;
}

py::dict readStereoCameraFile(const std::string& path) {
  const StereoCamera camera = released([&] { return readStereoCamera(path); });
  py::dict d;
  d["fu"] = camera.fu, d["fv"] = camera.fv, d["cu"] = camera.cu, d["cv"] = camera.cv, d["baseline"] = camera.b;
  d["pixel_variance"] = DictView::of(camera.pixel_variance);
  return d;
}

py::dict readPosePairFiles(const std::string& path_a, const std::string& path_b, bool by_row, double tolerance,
                           double norm_tolerance) {
  PosePairOptions options;
  options.by_row = by_row, options.tolerance = tolerance, options.reading.norm_tolerance = norm_tolerance;
  const PosePairs pairs = released([&] { return readPosePairs(path_a, path_b, options); });
  const std::vector<SE3d> all_a = featuresOf<SE3d>(pairs.a), all_b = featuresOf<SE3d>(pairs.b);
  std::vector<SE3d> a, b;
  std::vector<double> times;
  for (const PoseRows& row : pairs.rows) {
    a.push_back(all_a[row.a]), b.push_back(all_b[row.b]);
    if (row.time) times.push_back(*row.time);
  }
  py::dict d;
  d["a"] = arrayOfPoints(a), d["b"] = arrayOfPoints(b);
  d["rows"] = rowsOf(pairs.rows, 2, [](const PoseRows& row, double* out) {
    out[0] = static_cast<double>(row.a), out[1] = static_cast<double>(row.b);
  });
  d["times"] = pairs.by_time ? DictView::of(times) : py::none();
  d["largest_gap"] = pairs.largest_gap;
  d["unmatched_a"] = pairs.unmatched_a, d["unmatched_b"] = pairs.unmatched_b;
  return d;
}

py::dict dictOfPair(const TwoViewPair& pair) {
  const auto row = [](const Eigen::Vector4d& match, double* out) { Eigen::Map<Eigen::Vector4d>{out} = match; };
  py::dict d;
  d["family"] = name(pair.family), d["name"] = text(pair.name);
  d["matches"] = rowsOf(pair.matches, 4, row), d["validation"] = rowsOf(pair.validation, 4, row);
  d["labels"] = integers(std::vector<std::int64_t>(pair.labels.begin(), pair.labels.end()));
  d["corner"] = DictView::of(pair.corner), d["size"] = DictView::of(pair.size);
  return d;
}
py::dict readTwoViewPairFile(const std::string& path, const std::string& family) {
  return dictOfPair(released([&] { return readTwoViewPair(path, *named<PairFamily>(family)); }));
}
py::list readTwoViewPairFiles(const std::string& directory) {
  py::list all;
  for (const TwoViewPair& pair : released([&] { return readTwoViewPairs(directory); })) all.append(dictOfPair(pair));
  return all;
}

}  // namespace

void bindReaders(py::module_& module) {
  static py::exception<InputError> input_error(module, "InputError", PyExc_ValueError);
  module.def("read_features", &readFeatures);
  module.def("read_imu", &readImuFile);
  module.def("read_tracks", &readTracksFile);
  module.def("track",
             [](const std::vector<std::string>& paths, const std::string& times, std::size_t every, std::size_t tracks,
                std::size_t least) { return trackFiles(paths, times, every, {.tracks = tracks, .least = least}); });
  module.def("read_calibration", &readCalibrationFiles);
  module.def("read_imu_noise", [](const std::string& path) { return arrayOf(readImuNoise(path)); });
  module.def("read_ground_truth", &readGroundTruthFile);
  module.def("read_stereo_tracks", &readStereoTracksFile);
  module.def("read_camera_poses", &readCameraPosesFile);
  module.def("read_stereo_camera", &readStereoCameraFile);
  module.def("read_landmarks", [](const std::string& path) { return arrayOfPoints(readLandmarks(path)); });
  module.def("find_recording", [](const std::string& folder, const std::string& camera) {
    const FoundRecording found = released([&] { return findRecording(folder, camera); });
    py::dict d;
    d["images"] = found.images;
    d["image_times"] = found.image_times;
    d["imu"] = found.imu;
    d["truth"] = found.truth;
    d["calibration"] = found.calibration;
    d["camera"] = found.camera;
    d["notes"] = found.notes;
    return d;
  });
  module.def("read_matches", [](const std::string& path) { return arrayOfPoints(readMatches(path).points); });
  module.def("read_pose_pairs", &readPosePairFiles);
  module.def("read_two_view_pair", &readTwoViewPairFile);
  module.def("read_two_view_pairs", &readTwoViewPairFiles);
  py::register_exception_translator([](std::exception_ptr thrown) {
    try {
      if (thrown) std::rethrow_exception(thrown);
    } catch (const InputError& error) {
      input_error(error.what());
    }
  });
}

}  // namespace liestat::python
