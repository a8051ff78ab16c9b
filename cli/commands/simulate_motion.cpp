#include <cli/commands/commands.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <experiments/recording_files.hpp>
#include <report/json.hpp>
#include <experiments/motion_recording.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <iterator>
#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

constexpr const char* command_name = "liestat simulate motion";
constexpr double max_observations = 1e8, max_readings = 1e8;
constexpr const char* motion_files[] = {"tracks.csv", "truth.csv", "rates.csv", "imu.csv", "calibration.yaml"};

struct Options {
  std::string output, scene = "orbit";
  std::vector<double> gyroscope_bias;
  bool overwrite = false;
  MotionRecordingOptions recording;

  std::string path(const std::string& name) const { return output + "/" + name; }
};

void append(std::string& text, const Eigen::Vector3d& v) {
  fmt::format_to(std::back_inserter(text), ",{},{},{}", v.x(), v.y(), v.z());
}

std::string tracksCsv(const MotionRecording& recording) {
  std::string text = "frame,t_s,track,u,v,inlier\n";
  for (const MotionRecording::Observation& o : recording.observations) {
    fmt::format_to(std::back_inserter(text), "{},{},{},{},{},{}\n", o.frame, recording.frames[o.frame].time, o.track,
                   o.u, o.v, o.inlier ? 1 : 0);
  }
  return text;
}

/// The camera's poses, as `motion --truth` reads them, and what the gyroscope should have measured.
std::string truthCsv(const MotionRecording& recording, const Eigen::Vector3d& bias) {
  std::string text = "frame,t_s,R00,R01,R02,R10,R11,R12,R20,R21,R22,cx,cy,cz,wx,wy,wz,bias_x,bias_y,bias_z\n";
  for (std::size_t k = 0; k < recording.frames.size(); ++k) {
    const MotionRecording::Frame& frame = recording.frames[k];
    fmt::format_to(std::back_inserter(text), "{},{}", k, frame.time);
    const Eigen::Matrix3d R = frame.camera_T_world.so3().matrix();
    for (int i = 0; i < 3; ++i) append(text, R.row(i));
    append(text, frame.camera_T_world.inverse().translation()), append(text, frame.true_rate), append(text, bias);
    text += '\n';
  }
  return text;
}

std::string ratesCsv(const MotionRecording& recording) {
  std::string text = "frame,t_s,wx,wy,wz\n";
  for (std::size_t k = 0; k < recording.frames.size(); ++k) {
    fmt::format_to(std::back_inserter(text), "{},{}", k, recording.frames[k].time);
    append(text, recording.frames[k].rate);
    text += '\n';
  }
  return text;
}

std::string imuCsv(const MotionRecording& recording) {
  std::string text = "t,wx,wy,wz,ax,ay,az\n";
  for (const ImuSample<double>& reading : recording.imu) {
    fmt::format_to(std::back_inserter(text), "{}", reading.time);
    append(text, reading.angular_rate), append(text, reading.specific_force);
    text += '\n';
  }
  return text;
}

std::string commandOf(const Options& options, bool inertial) {
  const MotionSceneOptions& scene = options.recording.scene;
  std::vector<std::string> words = {"liestat", "motion", options.path("tracks.csv"), "--calibration",
                                    options.path("calibration.yaml")};
  const auto add = [&](const std::string& name, const std::string& value) {
    words.push_back(name), words.push_back(value);
  };
  if (inertial) {
    add("--imu", options.path("imu.csv"));
  } else {
    add("--rates", options.path("rates.csv")), add("--rates-axes", "vehicle");
    add("--rates-sigma", fmt::format("{:g}", scene.gyroscope_sigma));
  }
  if (!options.gyroscope_bias.empty()) words.emplace_back("--bias");
  if (scene.outliers > 0) words.emplace_back("--outliers");
  if (scene.sigma > 0) add("--sigma", fmt::format("{:g}", scene.sigma));
  add("--truth", options.path("truth.csv")), add("--min-motion", "0");
  return commandLine(words);
}

int runCommand(Options options) {
  MotionRecordingOptions& how = options.recording;
  for (const MotionWorld world : all_motion_worlds) {
    if (nameOf(world) == options.scene) how.scene.world = world;
  }
  const double seconds = static_cast<double>(how.frames) / how.frame_rate, readings = seconds * how.imu_rate;
  const double observations = static_cast<double>(how.frames) * static_cast<double>(how.scene.points);
  if (readings > max_readings || observations > max_observations) {
    throw OptionError(command_name, fmt::format("{:.3g} observations and {:.3g} readings", observations, readings),
                      fmt::format("{:g} and {:g} at most", max_observations, max_readings));
  }
  if (!options.gyroscope_bias.empty()) {
    how.gyroscope_bias << options.gyroscope_bias[0], options.gyroscope_bias[1], options.gyroscope_bias[2];
    if (!how.gyroscope_bias.allFinite()) throw OptionError(command_name, "the bias is not finite", "rad/s");
  }
  for (const char* name : motion_files) {
    const std::string path = options.path(name);
    if (options.overwrite || !std::filesystem::exists(path)) continue;
    throw InputError(path, 0, "the file is there", "another directory, or --overwrite");
  }
  const MotionRecording recording = recordMotion(how);
  createDirectory(options.output);
  writeOutput(options.path("tracks.csv"), tracksCsv(recording));
  writeOutput(options.path("truth.csv"), truthCsv(recording, how.gyroscope_bias));
  writeOutput(options.path("rates.csv"), ratesCsv(recording));
  writeOutput(options.path("imu.csv"), imuCsv(recording));
  writeOutput(options.path("calibration.yaml"), calibrationText(recording.camera, recording.noise));
  std::size_t wrong = 0;
  for (const MotionRecording::Observation& o : recording.observations) wrong += o.inlier ? 0 : 1;
  printLines(
      fmt::format("{} frames of {} points, scene '{}': {} observations, {} of them wrong; {} readings\n\n{}\n{}\n",
                  how.frames, how.scene.points, options.scene, recording.observations.size(), wrong,
                  recording.imu.size(), commandOf(options, false), commandOf(options, true)));
  return exit_fine;
}

}  // namespace

void addSimulateMotionCommand(const CommandList& simulate) {
  auto options = std::make_shared<Options>();
  MotionRecordingOptions& recording = options->recording;
  MotionSceneOptions& scene = recording.scene;
  scene.gyroscope_sigma = 0.1;
  const Command command =
      simulate.add("motion", "Tracks of a moving camera with a gyroscope on it, with their truth, for motion");
  command.option("--output", options->output, "Directory for the files").required();
  command.flag("--overwrite", options->overwrite, "Replace files of the same names");
  std::vector<std::string> scenes;
  for (const MotionWorld world : all_motion_worlds) scenes.emplace_back(nameOf(world));
  command.option("--scene", options->scene, "orbit (default), general, plane, narrow or turning").oneOf(scenes);
  command.option("--frames", recording.frames, "Default 100").range(std::size_t{2}, std::size_t{1000000});
  command.option("--points", scene.points, "In each pair of frames (default 20)")
      .range(std::size_t{1}, std::size_t{100000});
  command.option("--sigma", scene.sigma, "Standard deviation of image coordinates, px (default 1)").range(0.0, 1e3);
  command.option("--outliers", scene.outliers, "Share of wrong flows (default 0)").range(0.0, 1.0);
  command.option("--rotation", scene.rotation, "deg per frame (default 5)").range(0.0, 60.0);
  command.option("--speed", scene.speed, "m per frame, of all scenes but the orbit (default 0.1)").range(0.0, 1e3);
  command.option("--focal-length", scene.focal_length, "px (default 500)").range(1.0, 1e6);
  command.option("--image-size", scene.width, "px, width and height (default 512)").range(1.0, 1e6);
  command.option("--frame-rate", recording.frame_rate, "Hz (default 10)").range(1e-3, 1e4);
  command.option("--imu-rate", recording.imu_rate, "Hz (default 200)").range(1.0, 1e5);
  command.option("--gyroscope-sigma", scene.gyroscope_sigma, "deg per frame and axis (default 0.1)").range(1e-6, 1e3);
  command.option("--gyroscope-bias", options->gyroscope_bias, "rad/s, x,y,z in the sensor's axes (default 0)")
      .list(3, 3);
  command.option("--seed", recording.seed, "Seed; the same seed gives the same files (default 1)");
  command.run([options](const Invocation&) { return runCommand(*options); });
}

}  // namespace liestat::cli
