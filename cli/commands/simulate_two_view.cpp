#include <cli/commands/commands.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <report/json.hpp>
#include <experiments/two_view_scene.hpp>
#include <experiments/two_view_validation.hpp>
#include <lie/so3.hpp>

#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
using namespace experiments;
namespace {

constexpr const char* command_name = "liestat simulate two-view";

struct Options {
  std::string output, truth, motion = "essential";
  std::vector<double> image_size = {640, 480};
  bool overwrite = false;
  std::uint64_t seed = 1;
  TwoViewSceneOptions scene;
};

std::string matchesCsv(const TwoViewScene& scene) {
  std::string text = "x1,y1,x2,y2,inlier\n";
  for (std::size_t i = 0; i < scene.pixels.size(); ++i) {
    const Eigen::Vector4d& m = scene.pixels[i];
    text += fmt::format("{},{},{},{},{}\n", m[0], m[1], m[2], m[3], scene.inlier[i] ? 1 : 0);
  }
  return text;
}

void requireFree(const std::string& path) {
  if (path.empty() || path == "-" || !std::filesystem::exists(path)) return;
  throw InputError(path, 0, "the file is there", "another name, or --overwrite");
}

int runCommand(Options options, const Invocation& invocation) {
  TwoViewSceneOptions& scene_options = options.scene;
  scene_options.width = options.image_size[0], scene_options.height = options.image_size[1];
  for (const TwoViewMotion motion : all_two_view_motions) {
    if (name(motion) == options.motion) scene_options.motion = motion;
  }
  for (const double value : {scene_options.outliers, scene_options.sigma, scene_options.focal_length,
                             scene_options.width, scene_options.height}) {
    if (!std::isfinite(value)) throw OptionError(command_name, "an option is not a finite number", "finite ones");
  }
  if (!options.overwrite) requireFree(options.output), requireFree(options.truth);
  const TwoViewScene scene(scene_options, options.seed);
  if (!scene.possible) {
    throw OptionError(
        command_name,
        fmt::format("the motion '{}' takes all points out of images of {:g} x {:g} px at a focal length of {:g} px",
                    nameOf(scene_options.motion), scene_options.width, scene_options.height,
                    scene_options.focal_length),
        "larger images or a shorter focal length");
  }
  writeOutput(options.output, matchesCsv(scene));
  if (!options.truth.empty()) {
    writeJson(options.truth, jsonEnvelope(invocation.command_line, options.seed).fieldsOf(scene));
  }
  if (options.output != "-" && options.truth != "-") {
    const double f = scene_options.focal_length, w = scene_options.width, h = scene_options.height;
    const std::string intrinsics = fmt::format("{:g},{:g},{:g},{:g}", f, f, 0.5 * w, 0.5 * h);
    const std::string next = commandLine({"liestat", "two-view", options.output, "--intrinsics", intrinsics,
                                          "--image-size", fmt::format("{:g},{:g}", w, h), "--sigma",
                                          fmt::format("{:g}", scene_options.sigma > 0 ? scene_options.sigma : 1)});
    std::size_t good = 0;
    for (const bool inlier : scene.inlier) good += inlier ? 1 : 0;
    printLines(fmt::format("{} matches, {} of them wrong, of the motion '{}'\n\n{}\n", scene.pixels.size(),
                           scene.pixels.size() - good, nameOf(scene_options.motion), next));
  }
  return exit_fine;
}

}  // namespace

void addSimulateTwoViewCommand(const CommandList& simulate) {
  auto options = std::make_shared<Options>();
  const Command command = simulate.add("two-view", "Matches between two images, including wrong ones, for two-view");
  command.option("--output", options->output, "CSV file x1,y1,x2,y2,inlier ('-': standard output)").required();
  command.option("--truth", options->truth, "JSON file of the motion");
  command.flag("--overwrite", options->overwrite, "Replace files of these names");
  std::vector<std::string> motions;
  for (const TwoViewMotion motion : all_two_view_motions) motions.push_back(name(motion));
  command.option("--motion", options->motion, "Default essential; a list is in docs/program.md").oneOf(motions);
  command.option("--matches", options->scene.matches, "Default 100").range(std::size_t{1}, std::size_t{1000000});
  command.option("--outliers", options->scene.outliers, "Share of wrong matches (default 0.2)").range(0.0, 1.0);
  command.option("--sigma", options->scene.sigma, "Standard deviation of image coordinates, px (default 0.5)")
      .range(0.0, 1e3);
  command.option("--focal-length", options->scene.focal_length, "px (default 600)").range(1.0, 1e6);
  command.option("--image-size", options->image_size, "W,H, px (default 640,480)").list(2, 2).positive();
  command.option("--seed", options->seed, "Seed; the same seed gives the same file (default 1)");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
