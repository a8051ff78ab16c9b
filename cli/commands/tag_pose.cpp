#include <cli/commands/commands.hpp>
#include <cli/commands/target_images.hpp>
#include <cli/show/units.hpp>
#include <formats/input_error.hpp>
#include <report/publish.hpp>
#include <report/table.hpp>

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

namespace liestat::cli {
namespace {

constexpr const char* tag_pose_name = "liestat tag-pose";

struct TagPoseOptions {
  std::vector<std::string> images;
  std::string target, calibration, camera, json;
};

struct TagPoses {
  std::vector<ImagePose> images;
};
template <class V>
void describe(V& v, const TagPoses& x) {
  v("images", x.images);
}

std::string poseInWords(const SE3d& pose, const Eigen::Matrix<double, 6, 6>& covariance) {
  const Eigen::Vector3d t = pose.translation(), r = degrees * pose.so3().log();
  std::string text = fmt::format(
      "  translation      {: .6f} {: .6f} {: .6f} m\n  rotation vector  {: .4f} {: .4f} "
      "{: .4f} deg\n",
      t[0], t[1], t[2], r[0], r[1], r[2]);
  if (!covariance.allFinite()) return text;
  Eigen::Matrix<double, 6, 1> s = covariance.diagonal().cwiseSqrt();
  return text + fmt::format("  sd, target axes  {:.2g} {:.2g} {:.2g} m, {:.2g} {:.2g} {:.2g} deg\n", s[0], s[1], s[2],
                            degrees * s[3], degrees * s[4], degrees * s[5]);
}

std::string textOf(const ImagePose& image) {
  std::string text = image.image + ": ";
  if (!image.none.empty()) return text + image.none + "\n";
  const TargetPose& x = image.target;
  const PlanarPoseResult& r = x.result;
  text += r.verdict().text + "\n";
  if (x.id >= 0) text += fmt::format("  tag {}, ", x.id);
  text += fmt::format("{}{} points, sigma {:.2g} px; tilt {:.1f} deg; noise {:.1f} grey values, blur {:.2f} px\n",
                      x.id >= 0 ? "" : "  ", x.points, x.sigma, degrees * r.tilt, x.noise, x.blur);
  text += poseInWords(r.pose.mean, r.pose.covariance);
  text += fmt::format("  chi2 {} ({} degrees of freedom, p {})\n", number(r.fit.chi2, 3), r.fit.degrees_of_freedom,
                      number(r.fit.p, 2));
  if (x.not_fitted > 0) text += fmt::format("  {} points do not look like the target\n", x.not_fitted);
  if (x.misfit > 1) text += fmt::format("  the pattern leaves {:.1f} times what noise would\n", x.misfit);
  if (!r.rival) return text + "  no rival\n";
  text += r.likelihood_ratio < min_likelihood_ratio
              ? fmt::format("  rival, NOT excluded (likelihood ratio {:.3g}):\n", r.likelihood_ratio)
              : fmt::format("  rival, excluded (likelihood ratio {:.3g}):\n", r.likelihood_ratio);
  return text + poseInWords(r.rival->mean, r.rival->covariance);
}

int runCommand(const TagPoseOptions& options, const Invocation& invocation) {
  const Target target = targetFrom(options.target, tag_pose_name);
  const TagPoses poses{
      posesInImages(options.images, target, cameraOf(options.calibration, options.camera), tag_pose_name)};
  std::string text;
  bool trusted = true;
  for (const ImagePose& image : poses.images) {
    text += textOf(image);
    trusted = trusted && image.none.empty() && image.target.result.ok();
  }
  publishResult(options.json, text, invocation.command_line, std::nullopt, poses);
  return trusted ? exit_fine : exit_not_trusted;
}

}  // namespace

void addTagPoseCommand(const CommandList& program) {
  auto options = std::make_shared<TagPoseOptions>();
  const Command command =
      program.add("tag-pose", "The pose of a tag or a chessboard in images, its covariance, and its rival");
  command.option("IMAGE", options->images, "Images that show the target").required();
  command.option("--target", options->target, "april:36h11:0.05, april:36h11:0.05:7 (tag 7) or chessboard:9x6:0.025")
      .required();
  command.option("--calibration", options->calibration, "The camera: OpenCV's YAML or XML, ROS, Kalibr, EuRoC")
      .required();
  command.option("--camera", options->camera, "Its name, where the calibration has several");
  command.option("--json", options->json, "Write the result to a JSON file ('-': standard output)");
  command.run([options](const Invocation& invocation) { return runCommand(*options, invocation); });
}

}  // namespace liestat::cli
