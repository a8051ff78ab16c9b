#include <cli/commands/commands.hpp>
#include <cli/commands/motion_input.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/tracks.hpp>
#include <report/json.hpp>
#include <cli/show/motion.hpp>
#include <fusion/motion/sequence.hpp>
#include <fusion/motion/study.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <map>
#include <memory>
#include <string>

namespace liestat::cli {
namespace {

constexpr const char* command_name = "liestat motion";

struct Options {
  MotionInputOptions input;
  MotionOptions motion;
  std::string truth, json, output, report;
  double min_motion = 0.1;
  std::size_t report_frame = MotionWindow::last_frame;
};

/// Throws where no filter serves the options.
void requirePlan(const MotionOptions& options, const MotionInput& input) {
  const MotionFault fault = planOf(options, input.gyroscope.clock()).fault;
  switch (fault) {
    case MotionFault::none:
      return;
    case MotionFault::composition_over_intervals:
      throw OptionError(command_name, inWords(fault), "--filter subspace or essential with --frames-apart");
    case MotionFault::bias_without_gyroscope:
      throw OptionError(command_name, "--bias asks for the bias of a gyroscope", "--rates or --imu");
    case MotionFault::no_time:
      throw InputError(input.gyroscope_file, 0, inWords(fault), "times that ascend");
  }
}

int runCommand(const Options& options, const Invocation& invocation) {
  const MotionInput input = readMotionInput(options.input);
  std::map<std::size_t, TrueCamera> truth;
  if (!options.truth.empty()) {
    for (const CameraPose& pose : readCameraPoses(options.truth)) {
      truth.emplace(pose.frame, TrueCamera{pose.R_camera_world, pose.c});
    }
  }
  requirePlan(options.motion, input);
  MotionWindow window(options.report_frame);
  MotionObserver observer;
  if (!options.report.empty()) {
    // The figures of one moment are of the whole interval, as its pairs are.
    observer = [&](const MotionFrame& frame, const MotionFilter& filter) {
      window.add(frame.frame, filter.pairs(), filter.tracks(), filter.stepEstimate());
    };
  }
  MotionResult result = estimateMotion(input.tracks.frames, options.motion, input.gyroscope, observer);
  result.outside = input.tracks.outside;
  if (!truth.empty()) compareWithTruth(result, truth, options.min_motion);

  if (options.json != "-" && options.output != "-") printLines(formatMotion(result));
  if (!options.output.empty()) writeOutput(options.output, motionCsv(result));
  if (!options.json.empty()) {
    writeJson(options.json, jsonEnvelope(invocation.command_line)("file", options.input.tracks).fieldsOf(result));
  }
  if (!options.report.empty()) {
    if (!window.has_looked_at()) {
      throw OptionError(fmt::format("--report-frame {}", window.looked_at()),
                        "there is no such frame with one before it",
                        fmt::format("one of {} to {}", result.frames.front().frame, result.frames.back().frame));
    }
    writeMotionReport(options.report, invocation.command_line, result, studyFrame(window, result));
  }
  return result.verdict().isYes() ? exit_fine : exit_not_trusted;
}

}  // namespace

void addMotionCommand(const CommandList& app) {
  auto options = std::make_shared<Options>();
  const Command command =
      app.add("motion", "Rigid motion from point tracks, frame by frame: direction, rotation, standard deviations");
  MotionInputOptions& input = options->input;
  command.option("FILE", input.tracks, "CSV frame,track,u,v in pixels (or uL,vL); '-': standard input").required();
  command.option("--intrinsics", input.intrinsics, "fu,fv,cu,cv in pixels, no distortion; go before the calibration's")
      .list(4, 4);
  command.option(
      "--calibration", input.calibration,
      "YAML with a camera (EuRoC, Kalibr, OpenVINS), its first one, and of an IMU; several files are merged");
  command
      .option("--sigma", input.sigma,
              "px: noise of each image coordinate (default: the tracks' column sigma, else 0.5)")
      .positive();
  command.option("--rates", input.rates, "CSV frame,t_s,wx,wy,wz: rotation rates in rad/s, as a prior");
  command.choice("--rates-axes", input.axes,
                 std::map<std::string, RateAxes>{{"camera", RateAxes::camera}, {"vehicle", RateAxes::vehicle}},
                 "camera: x right, y down, z forward (default); vehicle: x forward, y left, z up");
  command
      .option("--camera-tilt", input.camera_tilt,
              "roll,pitch,yaw in deg of the camera on the vehicle (about x, y, z; default 0,0,0)")
      .list(3, 3);
  command
      .option("--rates-rotation", input.rates_rotation,
              "x,y,z,w: quaternion that takes the rates' axes to the camera's, in place of names")
      .list(4, 4)
      .excludes("--rates-axes")
      .excludes("--camera-tilt");
  command.option("--rates-sigma", input.rate_sigma, "deg per frame, of each component (default 0.1)").positive();
  command.option("--imu", input.imu, "EuRoC's imu0/data.csv, or CSV t,wx,wy,wz,ax,ay,az: its gyroscope, as a prior")
      .excludes("--rates");
  command.option("--image-times", input.image_times, "EuRoC's cam0/data.csv, or CSV frame,t_s (default: a column t_s)");
  command.option("--gyroscope-noise", input.gyroscope_noise, "rad/s/rtHz (default: the calibration's)").positive();
  command.option("--gyroscope-bias", input.gyroscope_bias, "rad/s, x,y,z in the sensor's axes (default 0)").list(3, 3);
  command.option("--max-gap", input.largest_gap, "s between two readings (default 0.1)").positive();
  command.flag("--bias", options->motion.bias, "The gyroscope's bias is a state of the filter");
  command.option("--bias-sigma", options->motion.bias_sigma, "rad/s: of the bias at the start (default 0.02)")
      .positive();
  command.option("--truth", options->truth, "CSV frame,t_s,R00..R22,cx,cy,cz of the camera, to compare with");
  command.option("--min-motion", options->min_motion, "m: directions of less are not compared (default 0.1)")
      .notNegative();
  command.choice(
      "--flow", options->motion.flow,
      std::map<std::string, FlowChoice>{
          {"forward", FlowChoice::forward}, {"midpoint", FlowChoice::midpoint}, {"discrete", FlowChoice::discrete}},
      "forward, midpoint (default) or discrete (default with a gyroscope)");
  command.choice(
      "--filter", options->motion.filter,
      std::map<std::string, FilterChoice>{{"composition", FilterChoice::composition},
                                          {"subspace", FilterChoice::subspace},
                                          {"essential", FilterChoice::essential}},
      "composition (default: essential filter after the subspace filter has settled), subspace or essential");
  command
      .option("--frames-apart", options->motion.frames_apart,
              "Pairs over so many frames, for noise that drowns the motion of one (default 1; else --filter subspace)")
      .range<std::size_t>(std::size_t{1}, std::size_t{100});
  command.option("--starts", options->motion.starts, "Directions to start from (default 32)")
      .range<std::size_t>(std::size_t{1}, std::size_t{1024});
  command.option("--process-noise", options->motion.process_noise, "rad^2 per frame, of the direction (default 1e-5)")
      .notNegative();
  command.option("--rotation-noise", options->motion.rotation_noise, "rad^2 per frame, of the rotation (default 1e-6)")
      .notNegative();
  command.flag("--outliers", options->motion.outliers, "Expect wrong tracks");
  command.option("--passes", options->motion.passes, "Run a short sequence again from its own end (default 1)")
      .range<std::size_t>(std::size_t{1}, std::size_t{100});
  command.option("--output", options->output, "Write a line per frame to a CSV file ('-': standard output)");
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Directory for a page with estimates, residuals, traces and structure");
  command.option("--report-frame", options->report_frame, "The frame whose residual is drawn (default: the last)");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
