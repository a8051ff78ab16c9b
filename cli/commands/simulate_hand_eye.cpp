#include <cli/commands/commands.hpp>
#include <formats/input_error.hpp>
#include <formats/output_file.hpp>
#include <report/json.hpp>
#include <experiments/hand_eye_scene.hpp>

#include <fmt/format.h>

#include <array>
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

constexpr const char* command_name = "liestat simulate hand-eye";

enum class FileFormat { csv, tum };
constexpr auto words(FileFormat) { return std::array{"csv", "tum"}; }

struct Options {
  std::string output;
  FileFormat format = FileFormat::csv;
  bool overwrite = false;
  std::uint64_t seed = 1;
  HandEyeSceneOptions scene;

  std::string path(const char* name) const {
    return fmt::format("{}/{}.{}", output, name, format == FileFormat::tum ? "txt" : "csv");
  }
  std::string truth() const { return output + "/truth.json"; }
};

/// Row i at the time i (s), with covariances unless the format has no place for them.
std::string posesText(const HandEyeScene& scene, bool is_a, bool tum) {
  std::string text = tum ? "# t tx ty tz qx qy qz qw\n" : "t,tx,ty,tz,qx,qy,qz,qw";
  if (!tum) {
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) text += fmt::format(",cov_{}{}", i, j);
    }
    text += "\n";
  }
  const char* separator = tum ? " " : ",";
  for (std::size_t k = 0; k < scene.pairs.size(); ++k) {
    const Gaussian<SE3d>& pose = is_a ? scene.pairs[k].a : scene.pairs[k].b;
    text += fmt::format("{}", k);
    const auto add = [&](double value) { text += fmt::format("{}{}", separator, value); };
    for (int i = 0; i < 3; ++i) add(pose.mean.translation()[i]);
    for (int i = 0; i < 4; ++i) add(pose.mean.so3().params()[i]);
    if (!tum) {
      for (int i = 0; i < 6; ++i) {
        for (int j = i; j < 6; ++j) add(pose.covariance(i, j));
      }
    }
    text += "\n";
  }
  return text;
}

int runCommand(const Options& options, const Invocation& invocation) {
  const HandEyeSceneOptions& scene_options = options.scene;
  for (const double value : {scene_options.noise_factor, scene_options.outliers}) {
    if (!std::isfinite(value)) throw OptionError(command_name, "an option is not a finite number", "finite ones");
  }
  const bool tum = options.format == FileFormat::tum;
  if (!options.overwrite) {
    for (const std::string& path : {options.path("a"), options.path("b"), options.truth()}) {
      if (std::filesystem::exists(path)) throw InputError(path, 0, "the file is there", "another name, or --overwrite");
    }
  }
  const HandEyeScene scene(scene_options, options.seed);
  createDirectory(options.output);
  writeOutput(options.path("a"), posesText(scene, true, tum));
  writeOutput(options.path("b"), posesText(scene, false, tum));
  writeJson(options.truth(), jsonEnvelope(invocation.command_line, options.seed).fieldsOf(scene));
  std::vector<std::string> words = {"liestat", "hand-eye", options.path("a"), options.path("b")};
  if (scene_options.relative) words.emplace_back("--relative");
  std::size_t wrong = 0;
  for (const bool right : scene.inlier) wrong += right ? 0 : 1;
  printLines(fmt::format("{} pairs of {}, {} of them wrong, motion '{}'\n\n{}\n", scene.pairs.size(),
                         scene_options.relative ? "motions" : "poses", wrong, name(scene_options.motion),
                         commandLine(words)));
  return exit_fine;
}

}  // namespace

void addSimulateHandEyeCommand(const CommandList& simulate) {
  auto options = std::make_shared<Options>();
  const Command command =
      simulate.add("hand-eye", "Poses of a gripper and of the camera on it, including wrong ones, for hand-eye");
  command.option("--output", options->output, "Directory for a.csv, b.csv (a.txt, b.txt) and truth.json").required();
  command.flag("--overwrite", options->overwrite, "Replace files of these names");
  command.choice("--format", options->format, "csv with covariances (default), or tum without");
  command.choice("--motion", options->scene.motion, "Default general; a list is in docs/program.md");
  command.choice("--noise", options->scene.noise, "isotropic (default), anisotropic or target");
  command.option("--noise-factor", options->scene.noise_factor, "Multiplies the standard deviations (default 1)")
      .range(1e-6, 1e3);
  command.option("--pairs", options->scene.pairs, "Default 20").range(std::size_t{1}, std::size_t{100000});
  command.flag("--relative", options->scene.relative, "Independent motions, for AX = XB");
  command.option("--outliers", options->scene.outliers, "Share of wrong pairs (default 0)").range(0.0, 1.0);
  command.choice("--outlier-kind", options->scene.outlier_kind, "gross (default), mild, flips or cluster");
  command.option("--seed", options->seed, "Seed; the same seed gives the same files (default 1)");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
