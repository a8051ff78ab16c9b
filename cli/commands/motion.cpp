#include <cli/commands/commands.hpp>
#include <cli/io/calibration.hpp>
#include <cli/io/camera.hpp>
#include <cli/io/input_error.hpp>
#include <cli/io/numeric_table.hpp>
#include <cli/io/output_file.hpp>
#include <cli/io/tracks.hpp>
#include <cli/show/json.hpp>
#include <cli/show/motion.hpp>
#include <cli/show/motion_report.hpp>
#include <cli/show/units.hpp>
#include <fusion/motion/gyroscope.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <fusion/motion/track_pairs.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr std::size_t most_frames = 1000000;

enum class FilterChoice { composition, subspace };
enum class RateAxes { camera, vehicle };

struct Options {
  std::string tracks, calibration, rates, truth, json, output, report;
  std::vector<double> intrinsics;
  Flow flow = Flow::midpoint;
  FilterChoice filter = FilterChoice::composition;
  RateAxes axes = RateAxes::camera;
  double sigma = 0.5, rate_sigma = 0.1, process_noise = 1e-5, rotation_noise = 1e-6, least_motion = 0.1;
  std::size_t starts = 32, passes = 1, report_frame = MotionWindow::last_frame;
  bool outliers = false;
};

using Frames = std::map<std::size_t, std::vector<TrackObservation>>;

Camera cameraOf(const Options& options) {
  if (options.calibration.empty() && options.intrinsics.empty()) {
    throw InputError("liestat motion", 0, "the camera is not known", "--intrinsics fu,fv,cu,cv or --calibration FILE");
  }
  if (options.calibration.empty()) return cameraFromIntrinsics(options.intrinsics);
  const Calibration calibration = readCalibration({options.calibration});
  if (calibration.cameras.empty()) throw InputError(options.calibration, 0, "there is no camera", "one");
  return calibration.cameras.front().camera;
}

Frames readFrames(const Options& options, const Camera& camera) {
  const NumericTable table = readTable(options.tracks, {"frame", "track"}, {"u", "v", "uL", "vL"});
  const bool left = !table.has("u");
  if (!(table.has(left ? "uL" : "u") && table.has(left ? "vL" : "v"))) {
    throw InputError(table.file(), 0, "there are no image coordinates", "columns u and v, or uL and vL");
  }
  const std::size_t u = table.column(left ? "uL" : "u"), v = table.column(left ? "vL" : "v");
  const double sigma = options.sigma / std::sqrt(camera.fu * camera.fv);
  Frames frames;
  std::set<std::pair<std::size_t, std::size_t>> seen;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::size_t frame = table.index(row, 0), track = table.index(row, 1);
    if (!seen.emplace(frame, track).second) {
      throw InputError(table.file(), table.line(row), fmt::format("track {} again in frame {}", track, frame),
                       "it once per frame");
    }
    std::vector<TrackObservation>& observations = frames[frame];
    const auto bearing = camera.bearing({table(row, u), table(row, v)});
    if (bearing && bearing->z() > 0) observations.push_back({track, bearing->head<2>() / bearing->z(), sigma});
  }
  if (frames.rbegin()->first - frames.begin()->first > most_frames) {
    throw InputError(table.file(), 0,
                     fmt::format("frames from {} to {}", frames.begin()->first, frames.rbegin()->first),
                     fmt::format("at most {} of them", most_frames));
  }
  return frames;
}

struct Rate {
  double time = 0;
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
};
std::map<std::size_t, Rate> readRates(const std::string& path) {
  std::map<std::size_t, Rate> rates;
  const NumericTable table = readTable(path, {"frame", "t_s", "wx", "wy", "wz"});
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const Rate rate{table(row, 1), {table(row, 2), table(row, 3), table(row, 4)}};
    if (!rates.emplace(table.index(row, 0), rate).second) {
      throw InputError(table.file(), table.line(row), fmt::format("frame {} again", table.index(row, 0)), "it once");
    }
  }
  return rates;
}

/// The rotation between two frames, by the mean of both rates; none where one is missing or time does not pass.
std::optional<GyroscopeRotation> rotationBetween(const std::map<std::size_t, Rate>& rates, std::size_t frame,
                                                 const Options& options) {
  const auto second = rates.find(frame);
  const auto first = frame > 0 ? rates.find(frame - 1) : rates.end();
  if (first == rates.end() || second == rates.end()) return std::nullopt;
  const double seconds = second->second.time - first->second.time;
  if (!(seconds > 0)) return std::nullopt;
  Eigen::Matrix3d camera_R_sensor = Eigen::Matrix3d::Identity();
  if (options.axes == RateAxes::vehicle) camera_R_sensor << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  return gyroscopeRotation(Eigen::Vector3d(0.5 * (first->second.rate + second->second.rate)), seconds,
                           options.rate_sigma / degrees / seconds, SO3d::fitToSO3(camera_R_sensor));
}

/// The errors where the camera moved by `least` metres from the frame before.
void compare(MotionFrame& frame, const std::map<std::size_t, CameraPose>& truth, double least) {
  const auto second = truth.find(frame.frame);
  const auto first = frame.frame > 0 ? truth.find(frame.frame - 1) : truth.end();
  if (first == truth.end() || second == truth.end()) return;
  const Eigen::Matrix3d& R_2 = second->second.R_camera_world;
  const SO3d R = SO3d::fitToSO3(Eigen::Matrix3d(R_2 * first->second.R_camera_world.transpose()));
  const Eigen::Vector3d T = R_2 * (first->second.c - second->second.c);
  frame.truth = TrueMotion{R.log(), SO3d::leftJacobianInverse(R.log()) * T};
  frame.rotation_error = degrees * distance(frame.motion.rotation.mean, R);
  if (T.norm() > least) {
    frame.direction_error = degrees * distance(translationDirection(frame.motion).mean, S2d(T));
  }
}

int runCommand(const Options& options, const Invocation& invocation) {
  const Frames frames = readFrames(options, cameraOf(options));
  std::map<std::size_t, Rate> rates;
  if (!options.rates.empty()) rates = readRates(options.rates);
  std::map<std::size_t, CameraPose> truth;
  if (!options.truth.empty()) {
    for (const CameraPose& pose : readCameraPoses(options.truth)) truth.emplace(pose.frame, pose);
  }

  MotionFilterOptions how;
  how.flow = options.flow, how.starts = options.starts, how.outliers = options.outliers;
  how.process_noise = options.process_noise, how.rotation_noise = options.rotation_noise;
  MotionHandOver hand_over;
  hand_over.essential = options.filter == FilterChoice::composition;
  MotionFilter filter(how, hand_over);
  MotionWindow window(options.report_frame);
  MotionResult result;
  result.passes = options.passes, result.with_gyroscope = !rates.empty(), result.with_truth = !truth.empty();
  for (std::size_t pass = 0; pass < options.passes; ++pass) {
    TrackPairs tracks;
    result.frames.clear();
    for (std::size_t k = frames.begin()->first; k <= frames.rbegin()->first; ++k) {
      const auto at = frames.find(k);
      const auto pairs = tracks.add(at == frames.end() ? std::span<const TrackObservation>{} : std::span(at->second));
      if (k == frames.begin()->first) continue;
      const auto gyroscope = rotationBetween(rates, k, options);
      MotionFrame frame;
      frame.frame = k;
      frame.motion = gyroscope ? filter.update(pairs, *gyroscope) : filter.update(pairs);
      frame.essential = filter.essential_in_charge();
      compare(frame, truth, options.least_motion);
      result.frames.push_back(frame);
      if (!options.report.empty()) window.add(k, pairs, tracks.tracks(), frame.motion);
    }
  }
  if (result.frames.empty()) throw InputError(options.tracks, 0, "there is one frame", "two frames or more");
  result.hand_overs = filter.hand_overs(), result.fall_backs = filter.fall_backs();

  if (options.json != "-" && options.output != "-") printLines(formatMotion(result));
  if (!options.output.empty()) writeOutput(options.output, motionCsv(result));
  if (!options.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line);
    object.set("file", options.tracks);
    setMotion(object, result);
    writeJson(options.json, object);
  }
  if (!options.report.empty()) writeMotionReport(options.report, invocation.command_line, result, window, how);
  return result.usable() > 0 ? exit_fine : exit_not_trusted;
}

}  // namespace

void addMotionCommand(const CommandList& app) {
  auto options = std::make_shared<Options>();
  const Command command =
      app.add("motion", "Rigid motion from point tracks, frame by frame: direction, rotation, standard deviations");
  command.option("FILE", options->tracks, "CSV frame,track,u,v in pixels (or uL,vL); '-': standard input").required();
  command.option("--intrinsics", options->intrinsics, "fu,fv,cu,cv in pixels, no distortion").list(4, 4);
  command.option("--calibration", options->calibration, "YAML with a camera (EuRoC, Kalibr, OpenVINS); its first one")
      .excludes("--intrinsics");
  command.option("--rates", options->rates, "CSV frame,t_s,wx,wy,wz: rotation rates in rad/s, as a prior");
  command.choice("--rates-axes", options->axes,
                 std::map<std::string, RateAxes>{{"camera", RateAxes::camera}, {"vehicle", RateAxes::vehicle}},
                 "camera: x right, y down, z forward (default); vehicle: x forward, y left, z up");
  command.option("--rates-sigma", options->rate_sigma, "deg per frame, of each component (default 0.1)").positive();
  command.option("--truth", options->truth, "CSV frame,t_s,R00..R22,cx,cy,cz of the camera, to compare with");
  command.option("--least-motion", options->least_motion, "m: directions of less are not compared (default 0.1)")
      .notNegative();
  command.choice("--flow", options->flow,
                 std::map<std::string, Flow>{
                     {"forward", Flow::forward}, {"midpoint", Flow::midpoint}, {"discrete", Flow::discrete}},
                 "forward, midpoint (default) or discrete");
  command.choice("--filter", options->filter,
                 std::map<std::string, FilterChoice>{{"composition", FilterChoice::composition},
                                                     {"subspace", FilterChoice::subspace}},
                 "composition (default: essential filter after the subspace filter has settled) or subspace");
  command.option("--starts", options->starts, "Directions to start from (default 32)")
      .range<std::size_t>(std::size_t{1}, std::size_t{1024});
  command.option("--sigma", options->sigma, "px: noise of each image coordinate (default 0.5)").positive();
  command.option("--process-noise", options->process_noise, "rad^2 per frame, of the direction (default 1e-5)")
      .notNegative();
  command.option("--rotation-noise", options->rotation_noise, "rad^2 per frame, of the rotation (default 1e-6)")
      .notNegative();
  command.flag("--outliers", options->outliers, "Expect wrong tracks");
  command.option("--passes", options->passes, "Run a short sequence again from its own end (default 1)")
      .range<std::size_t>(std::size_t{1}, std::size_t{100});
  command.option("--output", options->output, "Write a line per frame to a CSV file ('-': standard output)");
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Directory for a page with estimates, residuals, traces and structure");
  command.option("--report-frame", options->report_frame, "The frame whose residual is drawn (default: the last)");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
