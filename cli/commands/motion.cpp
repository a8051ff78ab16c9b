#include <cli/commands/commands.hpp>
#include <cli/commands/motion_input.hpp>
#include <cli/io/input_error.hpp>
#include <cli/io/output_file.hpp>
#include <cli/io/tracks.hpp>
#include <cli/show/json.hpp>
#include <cli/show/motion.hpp>
#include <cli/show/motion_report.hpp>
#include <cli/show/units.hpp>
#include <fusion/motion/essential_filter.hpp>
#include <fusion/motion/gyroscope.hpp>
#include <fusion/motion/motion_filter.hpp>
#include <fusion/motion/track_pairs.hpp>

#include <algorithm>
#include <cstddef>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* command_name = "liestat motion";

enum class FilterChoice { automatic, composition, subspace, essential };
enum class FlowChoice { automatic, forward, midpoint, discrete };

struct Options {
  MotionInputOptions input;
  std::string truth, json, output, report;
  FlowChoice flow = FlowChoice::automatic;
  FilterChoice filter = FilterChoice::automatic;
  double process_noise = 1e-5, rotation_noise = 1e-6, least_motion = 0.1, bias_sigma = 0.02;
  std::size_t starts = 32, passes = 1, frames_apart = 1, report_frame = MotionWindow::last_frame;
  bool outliers = false, bias = false;
};

/// The filter that the options ask for, behind one call.
class ChosenFilter {
 public:
  ChosenFilter(FilterChoice choice, const MotionFilterOptions& options)
      : composed_(options, {.essential = choice == FilterChoice::composition}) {
    if (choice == FilterChoice::essential) essential_.emplace(options);
  }
  const MotionEstimate& update(std::span<const PointPair> pairs, const std::optional<GyroscopeRotation>& gyroscope) {
    if (essential_) return gyroscope ? essential_->update(pairs, *gyroscope) : essential_->update(pairs);
    return gyroscope ? composed_.update(pairs, *gyroscope) : composed_.update(pairs);
  }
  bool essentialInCharge() const { return essential_ || composed_.essential_in_charge(); }
  std::size_t handOvers() const { return composed_.hand_overs(); }
  std::size_t fallBacks() const { return composed_.fall_backs(); }

 private:
  MotionFilter composed_;
  std::optional<EssentialFilter> essential_;
};

/// The filter and its settings that the options come to for an input.
struct Plan {
  FilterChoice filter = FilterChoice::composition;
  MotionFilterOptions how;
  /// The interval counts as one step of time for the filter: the epipolar constraint knows no other.
  bool whole_intervals = false;
  double step_seconds = 0;  ///< of the filter's unit of time, where there is a gyroscope
};

Plan planOf(const Options& options, const MotionGyroscope& gyroscope) {
  Plan plan;
  plan.filter = options.filter;
  if (plan.filter == FilterChoice::automatic) {
    plan.filter = options.frames_apart > 1 ? FilterChoice::subspace : FilterChoice::composition;
  }
  if (plan.filter == FilterChoice::composition && options.frames_apart > 1) {
    throw InputError(command_name, 0, "the composition takes successive frames",
                     "--filter subspace or essential with --frames-apart");
  }
  MotionFilterOptions& how = plan.how;
  switch (options.flow) {
    case FlowChoice::automatic:
      how.flow = gyroscope.given() ? Flow::discrete : Flow::midpoint;
      break;
    case FlowChoice::forward:
      how.flow = Flow::forward;
      break;
    case FlowChoice::midpoint:
      how.flow = Flow::midpoint;
      break;
    case FlowChoice::discrete:
      how.flow = Flow::discrete;
      break;
  }
  plan.whole_intervals = how.flow == Flow::discrete || plan.filter == FilterChoice::essential;
  how.starts = options.starts, how.outliers = options.outliers;
  how.process_noise = options.process_noise, how.rotation_noise = options.rotation_noise;
  plan.step_seconds = gyroscope.seconds * static_cast<double>(plan.whole_intervals ? options.frames_apart : 1);
  if (!options.bias) return plan;
  if (!gyroscope.given()) {
    throw InputError(command_name, 0, "--bias asks for the bias of a gyroscope", "--rates or --imu");
  }
  if (!(plan.step_seconds > 0))
    throw InputError(gyroscope.file, 0, "no time passes between frames", "times that ascend");
  how.estimate_bias = true;
  how.bias_sigma = options.bias_sigma * plan.step_seconds;
  const double walk = gyroscope.bias_walk * plan.step_seconds;
  how.bias_noise = walk * walk * gyroscope.seconds;
  return plan;
}

/// The interval's rotation as a prior for the filter's step. Intervals of n frames overlap, and each reading counts n
/// times: the covariance is n times as large as that of one interval, so that all of them together claim no more.
GyroscopeRotation priorOf(GyroscopeRotation over, std::size_t frames, bool whole_interval) {
  const auto n = static_cast<double>(frames);
  over.covariance *= n;
  if (whole_interval) return over;
  over.rotation /= n, over.covariance /= n * n;
  return over;
}

/// A motion over an interval of n frames as one of a frame.
void divideByFrames(MotionEstimate& motion, std::size_t frames) {
  const auto n = static_cast<double>(frames);
  const Eigen::Vector3d omega = motion.rotation.mean.log(), one = omega / n;
  const Eigen::Matrix3d J = SO3d::rightJacobian(one) * SO3d::rightJacobianInverse(omega) / n;
  motion.rotation.mean = SO3d::exp(one);
  motion.rotation.covariance = J * motion.rotation.covariance * J.transpose();
  motion.mean_inverse_depth /= n, motion.mean_inverse_depth_variance /= n * n;
}

/// The errors against the truth over the interval of `frames` frames that ends in this one; those of the direction where
/// the camera moved by `least` metres.
void compare(MotionFrame& frame, const std::map<std::size_t, CameraPose>& truth, std::size_t frames, double least) {
  const auto second = truth.find(frame.frame);
  const auto first = frame.frame >= frames ? truth.find(frame.frame - frames) : truth.end();
  if (first == truth.end() || second == truth.end()) return;
  const Eigen::Matrix3d& R_2 = second->second.R_camera_world;
  const SO3d R = SO3d::fitToSO3(Eigen::Matrix3d(R_2 * first->second.R_camera_world.transpose()));
  const Eigen::Vector3d T = R_2 * (first->second.c - second->second.c);
  const auto n = static_cast<double>(frames);
  const Eigen::Vector3d turn = n * frame.motion.rotation.mean.log();
  frame.rotation_error = degrees * distance(SO3d::exp(turn), R) / n;
  // The velocity that is constant over the interval, T = J_l(Ω) V, by the true rotation: that of a noisy frame says little.
  const Eigen::Vector3d V = SO3d::leftJacobianInverse(R.log()) * T;
  frame.truth = TrueMotion{R.log() / n, V / n};
  if (!(T.norm() > least)) return;
  const bool velocity = frame.motion.meaning == DirectionMeaning::velocity;
  frame.direction_error = degrees * distance(frame.motion.direction.mean, S2d(velocity ? V : T));
}

/// The gyroscope's bias in the sensor's axes, rad/s, with what was taken off the readings before.
Gaussian<Eigen::Vector3d> biasRate(const MotionEstimate& motion, const MotionGyroscope& gyroscope, double seconds) {
  const Eigen::Matrix3d A = gyroscope.camera_R_sensor.matrix().transpose() / seconds;
  return {gyroscope.bias + gyroscopeBiasRate(motion.gyroscope_bias.mean, seconds, gyroscope.camera_R_sensor),
          A * motion.gyroscope_bias.covariance * A.transpose()};
}

int runCommand(const Options& options, const Invocation& invocation) {
  const MotionInput input = readMotionInput(options.input);
  const MotionGyroscope& gyroscope = input.gyroscope;
  const auto& frames = input.tracks.frames;
  std::map<std::size_t, CameraPose> truth;
  if (!options.truth.empty()) {
    for (const CameraPose& pose : readCameraPoses(options.truth)) truth.emplace(pose.frame, pose);
  }
  const Plan plan = planOf(options, gyroscope);
  ChosenFilter filter(plan.filter, plan.how);
  MotionWindow window(options.report_frame);
  MotionResult result;
  result.passes = options.passes, result.frames_apart = options.frames_apart;
  result.with_gyroscope = gyroscope.given(), result.with_bias = options.bias, result.with_truth = !truth.empty();
  result.outside = input.tracks.outside;
  for (std::size_t pass = 0; pass < options.passes; ++pass) {
    TrackPairs tracks({.frames = options.frames_apart, .shorter = !plan.whole_intervals});
    std::vector<PointPair> steps;
    result.frames.clear();
    const std::size_t begin = frames.begin()->first;
    for (std::size_t k = begin; k <= frames.rbegin()->first; ++k) {
      const auto at = frames.find(k);
      auto pairs = tracks.add(at == frames.end() ? std::span<const TrackObservation>{} : std::span(at->second));
      if (k == begin) continue;
      const std::size_t apart = std::min(options.frames_apart, k - begin);
      if (plan.whole_intervals) {
        steps.assign(pairs.begin(), pairs.end());
        for (PointPair& pair : steps) pair.frames = 1;
        pairs = steps;
      }
      MotionFrame frame;
      frame.frame = k;
      std::optional<GyroscopeRotation> prior;
      if (gyroscope.given()) {
        const MotionGyroscope::Between between = gyroscope.between(k - apart, k);
        if (between.rotation) prior = priorOf(*between.rotation, apart, plan.whole_intervals);
        frame.no_gyroscope = between.why;
      }
      frame.motion = filter.update(pairs, prior);
      frame.essential = filter.essentialInCharge();
      if (options.bias) frame.gyroscope_bias = biasRate(frame.motion, gyroscope, plan.step_seconds);
      // The figures of one moment are of the whole interval, as its pairs are.
      if (!options.report.empty()) window.add(k, pairs, tracks.tracks(), frame.motion);
      if (plan.whole_intervals && options.frames_apart > 1) divideByFrames(frame.motion, options.frames_apart);
      compare(frame, truth, apart, options.least_motion);
      result.frames.push_back(frame);
    }
  }
  result.hand_overs = filter.handOvers(), result.fall_backs = filter.fallBacks();

  if (options.json != "-" && options.output != "-") printLines(formatMotion(result));
  if (!options.output.empty()) writeOutput(options.output, motionCsv(result));
  if (!options.json.empty()) {
    JsonObject object = jsonEnvelope(invocation.command_line);
    object.set("file", options.input.tracks);
    setMotion(object, result);
    writeJson(options.json, object);
  }
  if (!options.report.empty()) writeMotionReport(options.report, invocation.command_line, result, window, plan.how);
  return result.usable() > 0 ? exit_fine : exit_not_trusted;
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
  command.option("--sigma", input.sigma, "px: noise of each image coordinate (default 0.5)").positive();
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
  command.flag("--bias", options->bias, "The gyroscope's bias is a state of the filter");
  command.option("--bias-sigma", options->bias_sigma, "rad/s: of the bias at the start (default 0.02)").positive();
  command.option("--truth", options->truth, "CSV frame,t_s,R00..R22,cx,cy,cz of the camera, to compare with");
  command.option("--min-motion", options->least_motion, "m: directions of less are not compared (default 0.1)")
      .notNegative();
  command.choice(
      "--flow", options->flow,
      std::map<std::string, FlowChoice>{
          {"forward", FlowChoice::forward}, {"midpoint", FlowChoice::midpoint}, {"discrete", FlowChoice::discrete}},
      "forward, midpoint (default) or discrete (default with a gyroscope)");
  command.choice(
      "--filter", options->filter,
      std::map<std::string, FilterChoice>{{"composition", FilterChoice::composition},
                                          {"subspace", FilterChoice::subspace},
                                          {"essential", FilterChoice::essential}},
      "composition (default: essential filter after the subspace filter has settled), subspace or essential");
  command
      .option("--frames-apart", options->frames_apart,
              "Pairs over so many frames, for noise that drowns the motion of one (default 1; else --filter subspace)")
      .range<std::size_t>(std::size_t{1}, std::size_t{100});
  command.option("--starts", options->starts, "Directions to start from (default 32)")
      .range<std::size_t>(std::size_t{1}, std::size_t{1024});
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
