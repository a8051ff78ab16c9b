#include <cli/commands/commands.hpp>
#include <formats/calibration.hpp>
#include <cli/commands/camera.hpp>
#include <formats/colmap.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <formats/tracks.hpp>
#include <report/publish.hpp>
#include <cli/show/progress.hpp>
#include <cli/show/two_view.hpp>
#include <fusion/two_view/two_view.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* command_name = "liestat two-view";

struct Options {
  std::string file, json, report, colmap, output;
  std::vector<std::string> calibration;
  std::vector<double> intrinsics, second_intrinsics, image_size, verticals;
  std::vector<std::string> nodes;
  std::size_t motions = 1;
  std::optional<double> sigma = {};
  TwoViewMotionOptions estimate;
};

const std::map<std::string, TwoViewNode> node_names = {{"free_zoom", TwoViewNode::free_zoom},
                                                       {"similarity", TwoViewNode::similarity},
                                                       {"affine", TwoViewNode::affine},
                                                       {"rotation_zoom", TwoViewNode::rotation_zoom},
                                                       {"affine_epipolar", TwoViewNode::affine_epipolar},
                                                       {"shared_focal", TwoViewNode::shared_focal}};

void takeCameras(const Options& options, TwoViewMotionOptions& estimate) {
  if (!options.calibration.empty()) {
    const Calibration calibration = readCalibration(options.calibration);
    if (calibration.cameras.empty()) {
      throw InputError(options.calibration.front(), 0, "there is no camera", "cam0");
    }
    estimate.first = calibration.cameras.front().camera;
  }
  if (!options.intrinsics.empty()) estimate.first = cameraFromIntrinsics(options.intrinsics);
  if (!options.second_intrinsics.empty()) {
    if (!estimate.first) throw OptionError(command_name, "only the second camera is known", "--intrinsics too");
    estimate.second = cameraFromIntrinsics(options.second_intrinsics);
  }
  for (const std::string& node : options.nodes) estimate.nodes.push_back(node_names.at(node));
  if (!options.verticals.empty()) {
    if (!estimate.first) throw OptionError(command_name, "verticals without a camera", "--intrinsics too");
    const Eigen::Map<const Eigen::Vector3d> first(options.verticals.data()), second(options.verticals.data() + 3);
    if (!(first.norm() > 0 && second.norm() > 0)) throw OptionError(command_name, "a vertical is zero", "directions");
    estimate.verticals = TwoViewVerticals{first, second};
  }
  if (!options.image_size.empty()) estimate.image_size = Eigen::Vector2d(options.image_size[0], options.image_size[1]);
}

int runSeveral(const Options& options, const TwoViewMotionOptions& estimate, TwoViewMotionsOutput output,
               const Invocation& invocation) {
  output.motions = estimateTwoViewMotions(output.matches, estimate, options.motions);
  publishResult(options.json, formatTwoViewMotions(output), invocation.command_line, estimate.search.seed, output);
  if (!options.report.empty()) writeTwoViewMotionsReport(options.report, invocation.command_line, output);
  return output.motions.verdict().isNo() ? exit_not_trusted : exit_fine;
}

/// The motion of a pair of COLMAP in its pixels.
TwoViewMotionEstimate estimatePair(const ColmapMatches& pair, TwoViewMotionOptions estimate) {
  if (!pair.fault.empty()) return {};
  estimate.first = pair.first_camera, estimate.second = pair.second_camera;
  if (estimate.first) return estimateTwoViewMotion(pair.matches, estimate);
  // The models without cameras take both images for equally large: their centres are what counts.
  estimate.image_size = pair.first_size.cwiseMax(pair.second_size);
  const Eigen::Vector2d a = 0.5 * (*estimate.image_size - pair.first_size),
                        b = 0.5 * (*estimate.image_size - pair.second_size);
  std::vector<Eigen::Vector4d> centred = pair.matches;
  for (Eigen::Vector4d& m : centred) m.head<2>() += a, m.tail<2>() += b;
  TwoViewMotionEstimate found = estimateTwoViewMotion(centred, estimate);
  Eigen::Matrix3d first = Eigen::Matrix3d::Identity(), second = first;
  first.topRightCorner<2, 1>() = a, second.topRightCorner<2, 1>() = b;
  found.matrix = (found.equations == 1 ? second.transpose() : Eigen::Matrix3d(second.inverse())) * found.matrix * first;
  return found;
}

int runColmap(const Options& options, const Invocation& invocation) {
  if (options.output.empty()) {
    throw OptionError(command_name, "--colmap without --output", "--output COPY.db, where there is no file yet");
  }
  for (const auto& [given, option] :
       {std::pair(!options.file.empty(), "a file of matches"),
        {options.motions > 1, "--motions"},
        {!options.intrinsics.empty() || !options.calibration.empty(), "cameras (the database has them)"},
        {!options.image_size.empty(), "--image-size"},
        {!options.verticals.empty(), "--verticals"},
        {!options.report.empty(), "--report"}}) {
    if (given) throw OptionError(command_name, fmt::format("--colmap and {}", option), "one of them");
  }
  TwoViewMotionOptions estimate = options.estimate;
  for (const std::string& node : options.nodes) estimate.nodes.push_back(node_names.at(node));
  ColmapOutput output{options.colmap, estimate.sigma, {}, {}};
  std::optional<Progress> progress;
  forEachColmapPair(
      options.colmap, [&](std::size_t pairs) { progress.emplace("two-view", pairs); },
      [&](ColmapMatches&& pair) {
        output.pairs.push_back(colmapPairOf(pair, estimatePair(pair, estimate)));
        progress->advance();
      });
  progress.reset();
  writeColmapPairs(options.colmap, options.output, output.pairs);
  const std::string stem = std::filesystem::path(options.output).replace_extension().string();
  writeOutput(stem + ".g2o", formatColmapGraph(output.pairs));
  writeOutput(stem + ".csv", formatColmapEdges(output.pairs));
  output.files = {options.output, stem + ".g2o", stem + ".csv"};
  publishResult(options.json, formatColmapPairs(output), invocation.command_line, estimate.search.seed, output);
  return output.written() == 0 ? exit_not_trusted : exit_fine;
}

int runCommand(Options options, const Invocation& invocation) {
  if (options.sigma) options.estimate.sigma = *options.sigma;
  if (!options.colmap.empty()) return runColmap(options, invocation);
  if (options.file.empty()) throw OptionError(command_name, "nothing to read", "FILE, or --colmap DATABASE");
  if (!options.output.empty()) throw OptionError(command_name, "--output without --colmap", "--json or --report");
  TwoViewMotionOutput output;
  output.file = options.file;
  TwoViewMotionOptions estimate = options.estimate;
  const Matches matches = readMatches(options.file);
  output.matches = matches.points;
  if (!options.sigma && matches.sigma > 0) estimate.sigma = matches.sigma;
  takeCameras(options, estimate);
  if (options.motions > 1) return runSeveral(options, estimate, {output.file, output.matches, {}}, invocation);
  output.estimate = estimateTwoViewMotion(output.matches, estimate);
  std::string text = formatTwoViewMotion(output);
  if (matches.left_out > 0) {
    text += fmt::format("\nnote: {} tracks have more than twice the median sigma and take no part\n", matches.left_out);
  }
  publishResult(options.json, text, invocation.command_line, estimate.search.seed, output);
  if (!options.report.empty()) writeTwoViewMotionReport(options.report, invocation.command_line, output);
  return output.estimate.verdict().isNo() ? exit_not_trusted : exit_fine;
}

}  // namespace

void addTwoViewCommand(const CommandList& program) {
  auto options = std::make_shared<Options>();
  const Command command =
      program.add("two-view", "How the camera moved between two images, from matches of which some may be wrong");
  command.option(
      "file", options->file,
      "CSV with the columns x1,y1,x2,y2 (px), or tracks of two images by liestat track; '-' is standard input");
  command.option("--colmap", options->colmap,
                 "Database of COLMAP in place of a file: all its pairs with matches (needs SQLite)");
  command.option("--output", options->output,
                 "With --colmap: the copy of the database that has the geometries; beside it edges as .g2o and .csv");
  command.option("--intrinsics", options->intrinsics, "fu,fv,cu,cv of the camera, px (default: not known)").list(4, 4);
  command.option("--second-intrinsics", options->second_intrinsics, "The same of the second image's (default: equal)")
      .list(4, 4);
  command.option("--calibration", options->calibration,
                 "YAML of the camera, with its distortion (EuRoC, Kalibr, OpenVINS); --intrinsics go before it");
  command.option("--image-size", options->image_size, "W,H, px (default: the camera's, or the matches' bounding box)")
      .list(2, 2)
      .positive();
  command
      .option("--sigma", options->sigma,
              "Standard deviation of each image coordinate, px (default: of the tracks' column sigma, else 1)")
      .range(1e-6, 1e6);
  command
      .option("--outlier-share", options->estimate.search.outlier_share,
              "Of the right matches' errors that lie beyond the threshold (default 0.01)")
      .range(1e-6, 0.5);
  command
      .option("--draws", options->estimate.search.max_draws, "At most so many minimal samples a model (default 2000)")
      .range(std::size_t{1}, std::size_t{10000000});
  command
      .option("--motions", options->motions,
              "Up to so many motions: the inliers of each are taken out and the search goes on (default 1)")
      .range(std::size_t{1}, std::size_t{1000});
  std::vector<std::string> names;
  for (const auto& [node, value] : node_names) names.push_back(node);
  command
      .option("--models", options->nodes,
              "Models beyond the default ones: free_zoom, similarity, affine, rotation_zoom, affine_epipolar, "
              "shared_focal; a comma list")
      .list()
      .oneOf(names);
  command
      .option("--verticals", options->verticals,
              "x,y,z,x',y',z': the vertical in both cameras' frames; a motion that keeps it is then a model")
      .list(6, 6);
  command.flag("--planes", options->estimate.planes_only, "Homographies alone: with --motions the planes of a scene");
  command.flag("--noise-is-known", options->estimate.noise_is_known,
               "--sigma is right (default: noise may be larger, and the matches say by how much)");
  command
      .option("--focal-sigma", options->estimate.focal_length_sigma,
              "Standard deviation of the focal lengths, relative; the covariances then contain it (default 0: known)")
      .range(0.0, 0.5);
  command
      .option("--k1-sigma", options->estimate.k1_sigma,
              "Standard deviation of the distortion k1, likewise (default 0: known)")
      .range(0.0, 0.5);
  command.flag("--keep-contradictions", options->estimate.keep_contradictions,
               "Use matches that contradict each other (one point matched with two), too");
  command.option("--seed", options->estimate.search.seed, "Seed of the draws (default 1)");
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.option("--report", options->report, "Directory for a page with matches, errors and the lattice of models");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
