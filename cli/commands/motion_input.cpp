#include <cli/commands/motion_input.hpp>

#include <cli/commands/camera.hpp>
#include <formats/tracks.hpp>
#include <formats/imu.hpp>
#include <formats/input_error.hpp>
#include <formats/numeric_table.hpp>
#include <formats/text.hpp>
#include <cli/show/units.hpp>
#include <fusion/coordinate_units.hpp>
#include <fusion/motion/gyroscope.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace liestat::cli {
namespace {

constexpr const char* motion_name = "liestat motion";
/// A quaternion of the command line is a unit quaternion within this.
constexpr double unit_tolerance = 1e-3;
constexpr std::size_t max_frames = 1000000;
constexpr double default_sigma = 0.5;  // px
/// Fewer observations than the filter asks for in one frame tell nothing of their unit.
constexpr std::size_t min_observations_of_a_unit = 8;

Calibration calibrationOf(const MotionInputOptions& options) {
  return options.calibration.empty() ? Calibration{} : readCalibration(options.calibration);
}

Camera cameraOf(const MotionInputOptions& options, const Calibration& calibration) {
  if (!options.intrinsics.empty()) return cameraFromIntrinsics(options.intrinsics);
  if (options.calibration.empty()) {
    throw OptionError(motion_name, "the camera is not known", "--intrinsics fu,fv,cu,cv or --calibration FILE");
  }
  if (calibration.cameras.empty()) throw InputError(joined(options.calibration, ", "), 0, "there is no camera", "one");
  return calibration.cameras.front().camera;
}

/// Collects the rays of image coordinates and sees whether these have the unit of the focal lengths.
class TrackRays {
 public:
  TrackRays(const MotionInputOptions& options, const Camera& camera)
      : options_(options), camera_(camera), per_pixel_(1 / std::sqrt(camera.fu * camera.fv)) {
    if (options.sigma) requireSmall(*options.sigma, "--sigma");
  }

  /// `own`: px, or 0.
  void add(std::size_t frame, std::uint64_t track, double u, double v, double own) {
    if (!options_.sigma && own > 0) requireSmall(own, "sigma");
    const double sigma = options_.sigma.value_or(own > 0 ? own : default_sigma) * per_pixel_;
    std::vector<TrackObservation>& observations = tracks_.frames[frame];
    const auto bearing = camera_.bearing({u, v});
    if (bearing && bearing->z() > 0) {
      observations.push_back({track, bearing->head<2>() / bearing->z(), sigma});
      units_.add({u, v}, observations.back().at);
    } else {
      ++tracks_.outside;
    }
  }
  MotionTracks take() {
    if (tracks_.frames.size() < 2) throw InputError(options_.tracks, 0, "there is one frame", "two frames or more");
    const std::size_t first = tracks_.frames.begin()->first, last = tracks_.frames.rbegin()->first;
    if (last - first > max_frames) {
      throw InputError(options_.tracks, 0, fmt::format("frames from {} to {}", first, last),
                       fmt::format("at most {} of them", max_frames));
    }
    requireUnit();
    return std::move(tracks_);
  }

 private:
  void requireSmall(double sigma, const char* what) const {
    if (sigma * per_pixel_ <= 0.1) return;
    throw OptionError(
        motion_name,
        fmt::format("{} {:g} is {:.3g} of the focal length {:g}", what, sigma, sigma * per_pixel_, camera_.fu),
        "both in pixels");
  }
  void requireUnit() {
    if (units_.size() + tracks_.outside < min_observations_of_a_unit) return;
    if (units_.size() == 0) {
      throw InputError(options_.tracks, 0, "no point lies where the camera sees",
                       "pixels of the camera that was given");
    }
    if (const CoordinateFault fault = units_.fault(camera_)) {
      throw InputError(options_.tracks, 0, fault.found, fault.expected);
    }
  }

  const MotionInputOptions& options_;
  Camera camera_;
  double per_pixel_;
  MotionTracks tracks_;
  CoordinateUnits units_;
};

MotionTracks readTracks(const MotionInputOptions& options, const Camera& camera) {
  TrackRays rays(options, camera);
  const NumericTable table = readTable(options.tracks, {"frame", "track"}, {"u", "v", "uL", "vL", "sigma"});
  const bool left = !table.has("u");
  if (!(table.has(left ? "uL" : "u") && table.has(left ? "vL" : "v"))) {
    throw InputError(table.file(), 0, "there are no image coordinates", "columns u and v, or uL and vL");
  }
  const std::size_t u = table.column(left ? "uL" : "u"), v = table.column(left ? "vL" : "v");
  std::set<std::pair<std::size_t, std::size_t>> seen;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::size_t frame = table.index(row, 0), track = table.index(row, 1);
    if (!seen.emplace(frame, track).second) {
      throw InputError(table.file(), table.line(row), fmt::format("track {} again in frame {}", track, frame),
                       "it once per frame");
    }
    rays.add(frame, track, table(row, u), table(row, v),
             table.has("sigma") ? sigmaOfTrack(table, row, table.column("sigma")) : 0);
  }
  return rays.take();
}

/// Zero where none is given.
Eigen::Vector3d vectorOf(const std::vector<double>& list) {
  return list.empty() ? Eigen::Vector3d(Eigen::Vector3d::Zero()) : Eigen::Vector3d(list[0], list[1], list[2]);
}

SO3d cameraFromRates(const MotionInputOptions& options) {
  if (!options.rates_rotation.empty()) {
    const std::vector<double>& q = options.rates_rotation;
    const Eigen::Vector4d xyzw(q[0], q[1], q[2], q[3]);
    if (!(std::abs(xyzw.norm() - 1) < unit_tolerance)) {
      throw OptionError(motion_name, fmt::format("--rates-rotation has the norm {:g}", xyzw.norm()),
                        "a unit quaternion x,y,z,w");
    }
    const Eigen::Vector4d unit = xyzw.normalized();
    return SO3d(Eigen::Quaterniond(unit[3], unit[0], unit[1], unit[2]));
  }
  if (options.axes == RateAxes::camera) {
    if (!options.camera_tilt.empty()) {
      throw OptionError(motion_name, "--camera-tilt is that of a camera on a vehicle", "--rates-axes vehicle");
    }
    return {};
  }
  Eigen::Matrix3d camera_R_ahead;
  camera_R_ahead << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  SO3d vehicle_R_ahead;
  if (!options.camera_tilt.empty()) {
    const Eigen::Vector3d tilt = vectorOf(options.camera_tilt) / degrees;
    vehicle_R_ahead = SO3d::exp(Eigen::Vector3d(0, 0, tilt.z())) * SO3d::exp(Eigen::Vector3d(0, tilt.y(), 0)) *
                      SO3d::exp(Eigen::Vector3d(tilt.x(), 0, 0));
  }
  return SO3d::fitToSO3(camera_R_ahead) * vehicle_R_ahead.inverse();
}

/// Sets the gyroscope and the name of its file.
void readRates(const MotionInputOptions& options, MotionInput& input) {
  std::map<std::size_t, FrameRate> rates;
  const NumericTable table = readTable(options.rates, {"frame", "t_s", "wx", "wy", "wz"});
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const FrameRate rate{table(row, 1), {table(row, 2), table(row, 3), table(row, 4)}};
    if (!rates.emplace(table.index(row, 0), rate).second) {
      throw InputError(table.file(), table.line(row), fmt::format("frame {} again", table.index(row, 0)), "it once");
    }
  }
  input.gyroscope_file = table.file();
  input.gyroscope = gyroscopeOfRates(std::move(rates), options.rate_sigma / degrees, cameraFromRates(options),
                                     vectorOf(options.gyroscope_bias));
}

ImuNoise<double> noiseOf(const MotionInputOptions& options, const Calibration& calibration) {
  ImuNoise<double> noise = calibration.imu.value_or(ImuNoise<double>{});
  if (options.gyroscope_noise) noise.gyroscope = *options.gyroscope_noise;
  if (!(noise.gyroscope > 0)) {
    throw InputError(joined(options.calibration, ", "), 0, "the gyroscope's density of noise is not known",
                     "an imu0 with gyroscope_noise_density, or --gyroscope-noise");
  }
  return noise;
}

}  // namespace

MotionInput readMotionInput(const MotionInputOptions& options) {
  if (!options.rates.empty() && !options.imu.empty()) {
    throw OptionError(motion_name, "there are both --rates and --imu", "one gyroscope");
  }
  for (const auto* list : {&options.camera_tilt, &options.gyroscope_bias}) {
    if (std::all_of(list->begin(), list->end(), [](double x) { return std::isfinite(x); })) continue;
    throw OptionError(motion_name, "--camera-tilt or --gyroscope-bias is not finite", "three numbers");
  }
  const Calibration calibration = calibrationOf(options);
  const Camera camera = cameraOf(options, calibration);
  MotionInput input;
  if (options.imu.empty()) {
    input.tracks = readTracks(options, camera);
    if (!options.rates.empty()) readRates(options, input);
    return input;
  }
  if (calibration.cameras.empty()) {
    throw OptionError(motion_name, "where the camera sits on the inertial sensor is not known",
                      "--calibration with T_cam_imu or T_imu_cam");
  }
  input.gyroscope_file = options.imu;
  ImuFile imu = readImu(options.imu);
  const ImageTracks images = readImageTracks(options.tracks, options.image_times, imu.start_ns);
  TrackRays rays(options, camera);
  for (const PixelObservation& seen : images.observations) {
    rays.add(images.frames[seen.image], images.track_ids[seen.track], seen.u, seen.v, seen.sigma);
  }
  input.tracks = rays.take();
  const CameraCalibration& first = calibration.cameras.front();
  std::map<std::size_t, double> times;
  for (std::size_t i = 0; i < images.times.size(); ++i) {
    times.emplace(images.frames[i], images.times[i] + first.timeshift_cam_imu);
  }
  GyroscopeReadings readings{std::move(imu.samples), times, {}};
  readings.how.preintegration.noise = noiseOf(options, calibration);
  readings.how.preintegration.bias.gyroscope = vectorOf(options.gyroscope_bias);
  readings.how.max_gap = options.largest_gap;
  readings.place = [lines = std::move(imu.lines), file = options.imu](std::size_t i) {
    return fmt::format("{}:{}", file, lines[i]);
  };
  input.gyroscope = gyroscopeOfReadings(std::move(readings), first.imu_T_cam.so3().inverse());
  // Another clock, or another recording.
  if (const std::string why = reasonWithoutCover(input.gyroscope, times); !why.empty()) {
    throw InputError(options.imu, 0,
                     "the readings cover no interval between two frames; " + why +
                         suspectedUnit(imu.start_ns, times.begin()->second),
                     "readings over the images' times, on the same clock (timeshift_cam_imu is applied)");
  }
  return input;
}

}  // namespace liestat::cli
