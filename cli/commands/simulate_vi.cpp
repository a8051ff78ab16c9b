#include <cli/commands/commands.hpp>
#include <formats/calibration.hpp>
#include <formats/imu.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <experiments/recording_files.hpp>
#include <formats/text.hpp>
#include <report/json.hpp>
#include <experiments/simulate_vi.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

constexpr const char* command_name = "liestat simulate vi";
/// Where the clock of a recording without a truth begins, ns since 1970; and what is too small to be such a time.
constexpr std::int64_t usual_start_ns = 1600000000000000000, min_start_ns = 1000000000000000;
constexpr double max_readings = 1e8, max_looks = 1e10;

struct Options {
  std::string truth, imu, output;
  std::vector<std::string> calibration;
  std::vector<double> box, gyroscope_bias, accelerometer_bias;
  std::optional<double> begin, end;
  bool overwrite = false;
  ViSceneOptions scene;
  double imu_rate = 200, imu_noise = 1, spacing = 0.1, gravity = 9.81;
};

struct Sensors {
  CameraCalibration camera = defaultCamera();
  std::optional<ImuNoise<double>> noise = adis16448;
};

Sensors sensorsOf(const Options& options) {
  Sensors sensors;
  if (options.calibration.empty()) return sensors;
  const Calibration calibration = readCalibration(options.calibration);
  if (calibration.cameras.empty()) throw InputError(joined(options.calibration, ", "), 0, "there is no camera", "cam0");
  sensors.camera = calibration.cameras.front();
  sensors.noise = calibration.imu;
  return sensors;
}

std::optional<Eigen::Vector3d> given(const std::vector<double>& list) {
  return list.empty() ? std::nullopt : std::optional(Eigen::Vector3d(list[0], list[1], list[2]));
}

void checkSize(const Options& options, double duration) {
  const double readings = duration * options.imu_rate;
  const double looks = duration * options.scene.image_rate * static_cast<double>(options.scene.landmarks);
  if (readings <= max_readings && looks <= max_looks) return;
  throw OptionError(command_name, fmt::format("{:.3g} readings, and {:.3g} looks at a landmark", readings, looks),
                    fmt::format("{:g} and {:g} at most", max_readings, max_looks));
}

SimulatedRecording simulate(const Options& options, const Sensors& sensors) {
  if (!options.imu.empty()) {
    if (options.truth.empty())
      throw OptionError(command_name, "there is no --truth", "where the body was that --imu recorded");
    const ImuFile imu = readImu(options.imu);
    if (imu.format != "euroc")
      throw InputError(options.imu, 0, "the times are seconds", "nanoseconds, as in the truth (EuRoC)");
    const std::vector<GroundTruth> truth = readGroundTruth(options.truth, imu.start_ns);
    const double begin = options.begin.value_or(std::max(imu.samples.front().time, truth.front().time));
    const double end = options.end.value_or(std::min(imu.samples.back().time, truth.back().time));
    checkSize(options, end - begin);
    SimulatedRecording recording = simulateImages(imu.samples, truth, begin, end, sensors.camera, options.scene);
    recording.start_ns = imu.start_ns;
    recording.noise = sensors.noise;
    return recording;
  }

  SyntheticImuOptions imu;
  imu.rate = options.imu_rate;
  imu.gravity = {0, 0, -options.gravity};
  if (!sensors.noise && options.imu_noise > 0) {
    throw InputError(joined(options.calibration, ", "), 0, "there is no IMU, whose noise would be simulated",
                     "a file with imu0 too, or --imu-noise 0");
  }
  const ImuNoise<double> nominal = sensors.noise.value_or(adis16448);
  imu.noise = scaled(nominal, options.imu_noise);
  imu.bias = calibratedBias(options.scene.seed);
  imu.bias.gyroscope = given(options.gyroscope_bias).value_or(imu.bias.gyroscope);
  imu.bias.accelerometer = given(options.accelerometer_bias).value_or(imu.bias.accelerometer);

  std::int64_t start_ns = usual_start_ns;
  std::optional<SplineTrajectory> motion;
  if (options.truth.empty()) {
    const double end = options.end.value_or(20);
    if (!(end > 0)) throw OptionError(command_name, fmt::format("the end is at {:.10g} s", end), "one after 0 s");
    checkSize(options, end);
    motion = builtInTrajectory(end, options.scene.seed);
  } else {
    const TextFile file = loadText(options.truth);
    start_ns = firstStamp(file.text, file.name);
    const std::vector<GroundTruth> truth = parseGroundTruth(file.text, file.name, start_ns);
    try {
      motion = trajectoryAlong(truth, options.spacing);
    } catch (const ImpossibleMotion& complaint) {
      throw InputError(file.name, 0, complaint.found(), complaint.expected());
    }
    // A simulator's clock may begin at zero; stamps so small are not known for nanoseconds.
    if (start_ns < min_start_ns) start_ns = usual_start_ns;
  }
  const double begin = options.begin.value_or(options.truth.empty() ? 0 : motion->begin());
  const double end = options.end.value_or(options.truth.empty() ? 20 : motion->end());
  checkSize(options, end - begin);
  SimulatedRecording recording = simulateMotion(*motion, begin, end, sensors.camera, imu, options.scene);
  recording.start_ns = start_ns;
  // Exact readings: no program can do with a noise of zero.
  if (options.imu_noise == 0) recording.noise = nominal;
  return recording;
}

/// The ranges of the parser let what is not a number through.
void checkFinite(const Options& options) {
  const ViSceneOptions& scene = options.scene;
  std::vector<double> values = {options.imu_rate,          options.imu_noise,      options.spacing, options.gravity,
                                scene.image_rate,          scene.pixel_noise,      scene.outliers,  scene.drift,
                                options.begin.value_or(0), options.end.value_or(0)};
  for (const auto* list : {&options.box, &options.gyroscope_bias, &options.accelerometer_bias})
    values.insert(values.end(), list->begin(), list->end());
  const bool finite = std::all_of(values.begin(), values.end(), [](double x) { return std::isfinite(x); });
  if (!finite) throw OptionError(command_name, "an option is not a finite number", "finite ones");
}

/// The recording and the files it was written to, in lines for the terminal. `as_recorded`: the readings are not simulated.
std::string describeRecording(const SimulatedRecording& recording, const ViSceneOptions& scene, bool as_recorded,
                              const std::string& directory) {
  std::string text;
  const auto print = [&text](const std::string& line) { text += line + "\n"; };
  const auto listed = [](const Eigen::Vector3d& v) {
    return fmt::format("{:.4g}, {:.4g}, {:.4g}", v.x(), v.y(), v.z());
  };
  const double duration = recording.imu.back().time - recording.imu.front().time;
  print(fmt::format("{:.4g} s: {} readings {}, {} images at {:g} Hz", duration, recording.imu.size(),
                    as_recorded ? "as recorded" : "simulated", recording.image_times.size(), scene.image_rate));
  std::vector<std::size_t> lengths;
  std::size_t outliers = 0;
  for (const SimulatedTrack& track : recording.tracks) {
    if (track.images > 0) lengths.push_back(track.images);
    outliers += track.outlier ? 1 : 0;
  }
  std::sort(lengths.begin(), lengths.end());
  print(fmt::format("{} landmarks on a box of {:.4g} x {:.4g} x {:.4g} m", scene.landmarks, recording.box.x(),
                    recording.box.y(), recording.box.z()));
  print(fmt::format(
      "{} tracks of {} images in the median, {:.3g} an image, {} that drift", lengths.size(),
      lengths.empty() ? 0 : lengths[lengths.size() / 2],
      static_cast<double>(recording.observations.size()) / static_cast<double>(recording.image_times.size()),
      outliers));
  const ImuBias<double>& bias = recording.truth.front().bias;
  print(
      fmt::format("biases at the beginning {} rad/s and {} m/s^2", listed(bias.gyroscope), listed(bias.accelerometer)));
  print("\n" + commandLine({"liestat", "vi-init", "--imu", directory + "/imu.csv", "--tracks",
                            directory + "/tracks.csv", "--image-times", directory + "/images.csv", "--calibration",
                            directory + "/calibration.yaml", "--truth", directory + "/truth.csv"}));
  return text;
}

int runCommand(Options options) {
  checkFinite(options);
  options.scene.box = given(options.box);
  if (options.begin && options.end && !(*options.begin < *options.end)) {
    throw OptionError(command_name,
                      fmt::format("the interval is from {:.10g} to {:.10g} s", *options.begin, *options.end),
                      "an end after the beginning");
  }
  if (!options.overwrite) requireOwnFiles(options.output);
  const Sensors sensors = sensorsOf(options);
  try {
    const SimulatedRecording recording = simulate(options, sensors);
    writeRecording(recording, options.output);
    printLines(describeRecording(recording, options.scene, !options.imu.empty(), options.output));
  } catch (const ImpossibleMotion& complaint) {
    throw OptionError(command_name, complaint.found(), complaint.expected());
  }
  return exit_fine;
}

}  // namespace

void addSimulateViCommand(const CommandList& simulate) {
  auto options = std::make_shared<Options>();
  ViSceneOptions& scene = options->scene;
  const Command command =
      simulate.add("vi", "A recording of an inertial sensor and of what a camera tracks, with its truth, for vi-init");
  command.option("--output", options->output, "Directory for the files").required();
  command.flag("--overwrite", options->overwrite, "Replace files of the same names, whoever has written them");
  command.option("--truth", options->truth, "EuRoC's ground truth to move along (default: a motion of our own)");
  command.option("--imu", options->imu,
                 "EuRoC's imu0/data.csv that belongs to it: kept as it is (default: simulated along a spline)");
  command.option("--calibration", options->calibration,
                 "YAML of the first camera and the IMU's noise, one file or several (default: a pinhole, ADIS16448)");
  command.option("--begin", options->begin,
                 "s since the first reading, or the truth's first row (default: as early as there is a truth)");
  command.option("--end", options->end, "The same (default: as late as there is a truth; 20 without)");
  command.option("--image-rate", scene.image_rate, "Hz (default 10)").range(1e-3, 1e4);
  command.option("--pixel-noise", scene.pixel_noise, "Standard deviation, pixels (default 1)").range(0.0, 1e4);
  command.option("--landmarks", scene.landmarks, "Points on the box (default 2000)")
      .range(std::size_t{1}, std::size_t{1000000});
  command.option("--features", scene.features, "At most so many tracks an image (default 40)")
      .range(std::size_t{1}, std::size_t{1000000});
  command.option("--box", options->box, "x,y,z: edges of the box around the motion, m (default 10,10,4 or larger)")
      .list(3, 3)
      .positive();
  command.option("--outliers", scene.outliers, "Fraction of the tracks that drift (default 0)").range(0.0, 1.0);
  command.option("--drift", scene.drift, "Of their random walk, pixels an image (default 8)").range(0.0, 1e4);
  command.option("--imu-rate", options->imu_rate, "Hz, of simulated readings (default 200)").range(1.0, 1e5);
  command.option("--imu-noise", options->imu_noise, "Times the calibration's densities (default 1; 0: exact)")
      .range(0.0, 1e6);
  command.option("--gyroscope-bias", options->gyroscope_bias, "rad/s, x,y,z (default: drawn, deviation 0.01)")
      .list(3, 3);
  command.option("--accelerometer-bias", options->accelerometer_bias, "m/s^2, x,y,z (default: drawn, deviation 0.05)")
      .list(3, 3);
  command.option("--knots", options->spacing, "s between the spline's control points (default 0.1)").range(1e-3, 10.0);
  command.option("--gravity", options->gravity, "m/s^2, downwards in the truth's world (default 9.81)")
      .range(0.0, 100.0);
  command.option("--seed", scene.seed, "Seed; the same seed gives the same files (default 1)");
  command.run([options](const Invocation&) { return runCommand(*options); });
}

}  // namespace liestat::cli
