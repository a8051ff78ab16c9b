#include <cli/commands/commands.hpp>
#include <cli/commands/reading_options.hpp>
#include <cli/commands/target_images.hpp>
#include <formats/features.hpp>
#include <formats/images.hpp>
#include <formats/input_error.hpp>
#include <formats/pose_pairs.hpp>
#include <formats/text.hpp>
#include <cli/show/hand_eye.hpp>
#include <report/publish.hpp>
#include <cli/show/units.hpp>
#include <fusion/hand_eye.hpp>
#include <fusion/hand_eye_hints.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* command_name = "liestat hand-eye";

struct Options {
  std::string file_a, file_b, json, report;
  PosePairOptions pairs;
  bool relative = false, invert_a = false, invert_b = false, keep_outliers = false;
  bool in_degrees = false, in_radians = false;
  std::vector<double> sigma_a, sigma_b;
  std::vector<std::string> unknowns;
  HandEyeOptions estimate;
  std::vector<std::string> images;
  std::string target, calibration, camera, times;
};

/// The sigmas of a file without covariances: 1 mm and 0.1 degrees, until the residuals tell.
Eigen::Matrix<double, 6, 1> assumedSigma() {
  Eigen::Matrix<double, 6, 1> sigma;
  sigma << Eigen::Vector3d::Constant(1e-3), Eigen::Vector3d::Constant(0.1 / degrees);
  return sigma;
}

/// ROT,TRANS or rx,ry,rz,tx,ty,tz (degrees, m) in the library's order and units.
Eigen::Matrix<double, 6, 1> sigmaFrom(const std::vector<double>& values, const char* option) {
  if (values.size() != 2 && values.size() != 6) {
    throw OptionError(command_name, fmt::format("{} has {} values", option, values.size()),
                      "ROT,TRANS or rx,ry,rz,tx,ty,tz (degrees and m)");
  }
  for (const double value : values) {
    if (!std::isfinite(value)) throw OptionError(command_name, fmt::format("{} is not finite", option), "finite ones");
  }
  Eigen::Matrix<double, 6, 1> sigma;
  for (std::size_t i = 0; i < 6; ++i) {
    const double value = values.size() == 2 ? values[i / 3] : values[i];
    sigma[static_cast<Eigen::Index>((i + 3) % 6)] = i < 3 ? value / degrees : value;
  }
  return sigma;
}

/// Decides on the noise of a file; its covariances are taken where it has them.
HandEyeFile fileOf(const FeatureFile& file, const std::string& path, const std::vector<double>& sigma,
                   const char* option, bool inverted, std::size_t unmatched) {
  HandEyeFile result{.path = sourceName(path),
                     .noise = PoseNoise::assumed,
                     .sigma = assumedSigma(),
                     .inverted = inverted,
                     .rows = file.size(),
                     .unmatched = unmatched};
  if (!file.covariances.empty()) {
    if (!sigma.empty()) {
      throw InputError(result.path, 0, fmt::format("the file has covariances, and {} is given", option), "one of them");
    }
    result.noise = PoseNoise::columns;
  } else if (!sigma.empty()) {
    result.noise = PoseNoise::option;
    result.sigma = sigmaFrom(sigma, option);
  }
  return result;
}
/// A pose as the file has it, with its noise.
SE3d meanOf(const FeatureFile& file, std::size_t row) {
  return SE3d::fromParams((SE3d::Params() << file.rotations[row].coeffs(), file.positions[row]).finished());
}
Gaussian<SE3d> poseOf(const FeatureFile& file, const HandEyeFile& how, std::size_t row) {
  if (how.noise == PoseNoise::columns) return {meanOf(file, row), file.covariances[row]};
  return {meanOf(file, row), how.sigma.cwiseAbs2().asDiagonal()};
}
/// The poses of a file as a stream, read as is meant.
std::vector<TimedPose> streamOf(const FeatureFile& file, bool inverted) {
  std::vector<TimedPose> stream;
  stream.reserve(file.size());
  for (std::size_t i = 0; i < file.size(); ++i) {
    stream.push_back({file.times[i], inverted ? meanOf(file, i).inverse() : meanOf(file, i)});
  }
  return stream;
}
void addNotes(std::vector<std::string>& notes, const FeatureFile& file, const std::string& name) {
  if (!file.weights.empty()) notes.push_back(fmt::format("the weights of {} are not used", name));
  if (file.n_normalised > 0) {
    notes.push_back(fmt::format("{}: {} {} normalised, off by {:.2g} at most", name, file.n_normalised,
                                file.n_normalised == 1 ? "rotation was" : "rotations were", file.largest_norm_error));
  }
}

/// The poses of a file that belong to pairs, read as is meant. The file's covariances are given up.
PackedPoses meantPoses(FeatureFile& file, const HandEyeFile& how, const PoseReading& reading,
                       const std::vector<PoseRows>& rows, std::size_t PoseRows::*row) {
  PackedPoses poses;
  poses.reserve(rows.size());
  for (const PoseRows& pair : rows) {
    poses.push_back(readPose(poseOf(file, how, pair.*row), reading));
  }
  file.covariances = {}, file.factors = {};
  return poses;
}
void requireDifferentPoses(const PosePairs& pairs, const HandEyeOutput& output) {
  for (const bool is_a : {true, false}) {
    const FeatureFile& file = is_a ? pairs.a : pairs.b;
    const auto pose = [&](const PoseRows& rows) { return meanOf(file, is_a ? rows.a : rows.b).params(); };
    const SE3d::Params first = pose(pairs.rows.front());
    const bool same = std::all_of(pairs.rows.begin(), pairs.rows.end(), [&](const PoseRows& rows) {
      return (pose(rows) - first).cwiseAbs().maxCoeff() < 1e-12 * (1 + first.cwiseAbs().maxCoeff());
    });
    if (same) {
      throw InputError((is_a ? output.a : output.b).path, 0,
                       fmt::format("all {} poses are the same", pairs.rows.size()),
                       output.result.world ? "at least three different ones" : "motions that differ");
    }
  }
}
void requireNoise(const HandEyeOutput& output) {
  const auto exact = [](const HandEyeFile& file) { return file.noise == PoseNoise::option && file.sigma.isZero(0); };
  if (exact(output.a) && exact(output.b)) {
    throw OptionError(command_name, "the poses of both files are exact (--sigma-a, --sigma-b)", "noise in one of them");
  }
}

/// Poses target_T_camera of images; those of `unusable` rows stand for nothing.
struct PosesOfImages {
  FeatureFile file;
  std::vector<bool> usable;
  std::vector<std::string> notes;
};
PosesOfImages posesOfImages(const Options& options) {
  if (options.target.empty() || options.calibration.empty()) {
    throw OptionError(command_name, "--images without --target or --calibration", "all three");
  }
  const Target target = targetFrom(options.target, command_name);
  const Camera camera = cameraOf(options.calibration, options.camera);
  const ImageRecording recording = imagesOf(options.images, options.times);
  if (!recording.video.empty()) throw InputError(recording.video, 0, "it is no image", "a folder, or images");
  PosesOfImages result;
  FeatureFile& file = result.file;
  file.kind = Feature::frame, file.times = recording.times, file.format = "images";
  std::vector<std::string> left_out;
  for (const ImagePose& image : posesInImages(recording.files, target, camera, command_name)) {
    const PlanarPoseResult& pose = image.target.result;
    const bool usable = image.none.empty() && pose.ok();
    result.usable.push_back(usable);
    if (!usable) left_out.push_back(image.image + ": " + (image.none.empty() ? pose.inWords() : image.none));
    const SE3d inverse = usable ? pose.pose.mean.inverse() : SE3d();
    const Eigen::Matrix<double, 6, 6> turned = pose.pose.mean.Adj();
    file.rotations.emplace_back(inverse.so3().params());
    file.positions.emplace_back(inverse.translation());
    file.covariances.emplace_back(usable
                                      ? Eigen::Matrix<double, 6, 6>(turned * pose.pose.covariance * turned.transpose())
                                      : Eigen::Matrix<double, 6, 6>::Identity());
    file.lines.push_back(file.lines.size() + 1);
  }
  if (left_out.empty()) return result;
  result.notes.push_back(fmt::format("{} of {} images are not used", left_out.size(), file.size()));
  constexpr std::size_t most = 5;
  for (std::size_t i = 0; i < std::min(most, left_out.size()); ++i) result.notes.push_back("  " + left_out[i]);
  if (left_out.size() > most) result.notes.push_back(fmt::format("  and {} more", left_out.size() - most));
  return result;
}
/// Pairs of a file and images, without those that give no pose.
PosePairs pairsWithImages(const Options& options, std::vector<std::string>& notes) {
  PosesOfImages images = posesOfImages(options);
  const std::string name =
      options.images.size() == 1 ? options.images[0] : fmt::format("{} images", images.file.size());
  PosePairs pairs = readPosePairs(options.file_a, std::move(images.file), name, options.pairs);
  std::erase_if(pairs.rows, [&](const PoseRows& rows) { return !images.usable[rows.b]; });
  notes = std::move(images.notes);
  if (pairs.rows.size() < options.pairs.least) {
    std::string why;
    for (const std::string& note : notes) why += "; " + note;
    throw InputError(name, 0, fmt::format("{} images have a pose of A and one of the target{}", pairs.rows.size(), why),
                     fmt::format("at least {}", options.pairs.least));
  }
  return pairs;
}

HandEyeOutput calibrate(Options options) {
  options.pairs.reading.angles = options.in_degrees   ? AngleUnit::degrees
                                 : options.in_radians ? AngleUnit::radians
                                                      : AngleUnit::unsaid;
  options.pairs.least = options.relative ? 2 : 3;
  if (!std::isfinite(options.pairs.tolerance)) throw OptionError(command_name, "--tolerance is not finite", "s");
  HandEyeOutput output;
  const bool of_images = !options.images.empty();
  if (of_images == !options.file_b.empty()) {
    throw OptionError(command_name, of_images ? "a file B and --images" : "no file B", "one of B and --images");
  }
  if (of_images && (options.relative || options.invert_b || !options.sigma_b.empty())) {
    throw OptionError(command_name, "--images with --relative, --invert-b or --sigma-b",
                      "none of them: images give target_T_camera with its covariance");
  }
  PosePairs pairs =
      of_images ? pairsWithImages(options, output.notes) : readPosePairs(options.file_a, options.file_b, options.pairs);
  if (of_images) options.file_b = options.images[0];
  output.a = fileOf(pairs.a, options.file_a, options.sigma_a, "--sigma-a", options.invert_a, pairs.unmatched_a);
  output.b = fileOf(pairs.b, options.file_b, options.sigma_b, "--sigma-b", options.invert_b, pairs.unmatched_b);
  output.by_time = pairs.by_time;
  output.tolerance = options.pairs.tolerance, output.largest_gap = pairs.largest_gap;
  addNotes(output.notes, pairs.a, output.a.path), addNotes(output.notes, pairs.b, output.b.path);
  output.options = options.estimate;
  output.options.find_outliers = !options.keep_outliers;
  output.options.known_noise = output.a.noise != PoseNoise::assumed && output.b.noise != PoseNoise::assumed;
  output.result.world = !options.relative;
  requireNoise(output);

  const auto timed = [](const PoseRows& rows) { return rows.time.has_value(); };
  if (std::all_of(pairs.rows.begin(), pairs.rows.end(), timed)) {
    for (const PoseRows& rows : pairs.rows) output.options.times.push_back(*rows.time);
  }
  requireDifferentPoses(pairs, output);
  HandEyeHintOptions hints;
  hints.reading.a.inverted = options.invert_a, hints.reading.b.inverted = options.invert_b;
  hints.doubt_a = output.a.noise == PoseNoise::columns, hints.doubt_b = output.b.noise == PoseNoise::columns;
  hints.estimate = output.options;
  std::vector<PosePair> to_explain;
  for (const std::size_t i :
       pairsToExplain(pairs.rows.size(), [&](std::size_t k) { return meanOf(pairs.b, pairs.rows[k].b); })) {
    to_explain.push_back({poseOf(pairs.a, output.a, pairs.rows[i].a), poseOf(pairs.b, output.b, pairs.rows[i].b)});
  }
  PosePairList meant;
  meant.a = meantPoses(pairs.a, output.a, hints.reading.a, pairs.rows, &PoseRows::a);
  meant.b = meantPoses(pairs.b, output.b, hints.reading.b, pairs.rows, &PoseRows::b);
  for (const std::string& unknown : options.unknowns) {
    const auto suspect = static_cast<std::size_t>(*named<HandEyeSuspect>(unknown));
    output.options.suspect_sigmas[suspect] = std::numeric_limits<double>::infinity();
  }
  HandEyeOptions estimate = output.options;
  if (pairs.by_time && !options.relative) {
    estimate.stream_of_a = streamOf(pairs.a, options.invert_a);
    if (estimate.interpolate) {
      for (std::size_t i = 0; i < meant.size(); ++i) estimate.times[i] = pairs.b.times[pairs.rows[i].b];
    }
  } else if (estimate.interpolate || estimate.largest_delay > 0 || estimate.suspect_sigmas[0] > 0) {
    throw OptionError(command_name, "--interpolate, --largest-delay and a delay need poses with times",
                      "files with times, without --by-row and --relative");
  }
  hints.estimate = output.options;
  output.options.times = {};
  output.rows = std::move(pairs.rows);
  pairs = {};
  output.result = options.relative ? estimateHandEye(std::move(meant), std::move(estimate))
                                   : estimateRobotWorld(std::move(meant), std::move(estimate));
  if (output.result.fault.kind == FaultKind::bad_covariance) {
    const PoseRows& rows = output.rows[output.result.fault.index];
    throw InputError(
        output.a.path, rows.line_a,
        fmt::format("the covariances of this pose and of {}:{} are singular together", output.b.path, rows.line_b),
        "noise in one of them in each direction");
  }
  if (output.result.fault) throw OptionError(command_name, describe(output.result.fault));
  output.hint = explainHandEye(to_explain, output.result, hints);
  return output;
}

int runCommand(const Options& options, const Invocation& invocation) {
  const HandEyeOutput output = calibrate(options);
  publishResult(options.json, formatHandEye(output), invocation.command_line, output.options.seed, output);
  if (!options.report.empty()) writeHandEyeReport(options.report, invocation.command_line, output);
  return output.result.verdict().isNo() ? exit_not_trusted : exit_fine;
}

}  // namespace

void addHandEyeCommand(const CommandList& program) {
  auto options = std::make_shared<Options>();
  const Command command =
      program.add("hand-eye", "The pose of a camera on a gripper, and of its target, from pairs of poses (AX = YB)");
  command.option("A", options->file_a, "Poses base_T_gripper: TUM, KITTI, EuRoC or CSV ('-': standard input)")
      .required();
  command.option("B", options->file_b, "Poses target_T_camera, likewise; or --images");
  command
      .option("--images", options->images,
              "A folder, or images, of a target: B, with covariances; by times, or by order where there are as many")
      .list();
  command.option("--target", options->target, "Of --images: april:36h11:0.05 or chessboard:9x6:0.025");
  command.option("--calibration", options->calibration, "Of --images: the camera (OpenCV, ROS, Kalibr, EuRoC)");
  command.option("--camera", options->camera, "Its name, where the calibration has several");
  command.option("--times", options->times, "Of --images: CSV frame,t_s with a row an image, or EuRoC's cam0/data.csv");
  command.flag("--relative", options->relative,
               "Rows are independent motions of gripper and camera, of two odometries (AX = XB)");
  command.flag("--invert-a", options->invert_a, "A holds gripper_T_base; covariances go with the poses");
  command.flag("--invert-b", options->invert_b, "B holds camera_T_target; likewise");
  command
      .option("--sigma-a", options->sigma_a,
              "Standard deviations of A: ROT,TRANS or rx,ry,rz,tx,ty,tz (degrees, m), in the axes of each pose of "
              "the file; 0: exact")
      .list(2, 6)
      .notNegative();
  command.option("--sigma-b", options->sigma_b, "The same of B").list(2, 6).notNegative();
  command
      .option("--tolerance", options->pairs.tolerance,
              "Largest difference of times that belong together, s (default 0.01)")
      .notNegative();
  command.flag("--interpolate", options->estimate.interpolate,
               "A is interpolated at the times of B; the error of interpolation, from every second row, is added");
  command
      .option("--estimate", options->unknowns,
              "Suspects that are estimated with X: delay, scale, focal_length, principal_x, principal_y")
      .list()
      .oneOf({"delay", "scale", "focal_length", "principal_x", "principal_y"});
  command
      .option("--delay-sigma", options->estimate.suspect_sigmas[0],
              "Standard deviation of the delay between the streams, s, which is then estimated with this prior")
      .notNegative();
  command
      .option("--board-scale-sigma", options->estimate.suspect_sigmas[1],
              "The same of the scale of A against B, a ratio")
      .notNegative();
  command
      .option("--focal-length-sigma", options->estimate.suspect_sigmas[2],
              "The same of the camera's focal length, a ratio")
      .notNegative();
  command
      .option("--largest-delay", options->estimate.largest_delay,
              "The delay is sought from where angular speeds agree best within so many seconds (default 0)")
      .notNegative();
  command.flag("--by-row", options->pairs.by_row, "Row i of A belongs to row i of B, whatever their times");
  command.flag("--keep-outliers", options->keep_outliers, "Use all pairs; wrong ones are not looked for");
  command.option("--samples", options->estimate.samples, "Samples of the search for wrong pairs (default 80)")
      .range(0, 1000000);
  command.option("--seed", options->estimate.seed, "Seed of starts and samples (default 1)");
  command.option("--format", options->pairs.reading.format, "Format of both files (default auto: by their first lines)")
      .oneOf(formatNames());
  declareReading(command, options->pairs.reading);
  const Option in_degrees = command.flag("--degrees", options->in_degrees, "Rotation vectors are in degrees");
  command.flag("--radians", options->in_radians, "Rotation vectors are in radians, those beyond a turn too")
      .excludes(in_degrees);
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Directory for a page with residuals, excitations and covariances");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
