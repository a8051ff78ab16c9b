#include <cli/commands/target_images.hpp>

#include <cli/show/progress.hpp>
#include <formats/calibration.hpp>
#include <formats/images.hpp>
#include <formats/input_error.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <system_error>
#include <utility>

namespace liestat::cli {
namespace {

std::vector<std::string> partsOf(const std::string& text, char separator) {
  std::vector<std::string> parts(1);
  for (const char c : text) {
    if (c == separator) {
      parts.emplace_back();
    } else {
      parts.back() += c;
    }
  }
  return parts;
}

std::optional<int> wholeNumber(const std::string& text, int largest) {
  if (text.empty() || text.size() > 5 || text.find_first_not_of("0123456789") != std::string::npos) return {};
  const int value = std::stoi(text);
  return value <= largest ? std::optional(value) : std::nullopt;
}

/// Families that are tried where the one that was asked for shows nothing.
constexpr const char* other_families[] = {"36h11", "25h9", "16h5", "Standard41h12"};

std::string idsOf(const std::vector<SeenTarget>& seen) {
  std::string text;
  for (const SeenTarget& x : seen) text += fmt::format("{}{}", text.empty() ? "" : ", ", x.id);
  return text;
}

/// The target in an image, or why there is none.
std::optional<SeenTarget> targetIn(const GreyView& image, const std::string& file, const Target& target,
                                   const ImageLibrary& library, const std::string& user, std::string& none) {
  std::string lacking;
  const std::vector<SeenTarget> all = library.findTargets(image, target, lacking);
  if (!lacking.empty()) {
    if (lacking.rfind("lib", 0) == 0) throw InputError(user, 0, "this build does not look for such targets", lacking);
    throw OptionError(user, lacking);
  }
  std::vector<SeenTarget> seen;
  std::copy_if(all.begin(), all.end(), std::back_inserter(seen),
               [&](const SeenTarget& x) { return target.id < 0 || x.id == target.id; });
  if (seen.size() > 1) {
    throw InputError(file, 0,
                     target.id < 0 ? fmt::format("it shows the tags {}", idsOf(seen))
                                   : fmt::format("it shows the tag {} {} times", target.id, seen.size()),
                     target.id < 0
                         ? fmt::format("one, or its number: april:{}:{}:{}", target.family, target.size, seen[0].id)
                         : "one");
  }
  if (seen.size() == 1) return std::move(seen[0]);
  if (target.kind == Target::Kind::chessboard) {
    none = fmt::format("no chessboard of {} x {} inner corners is found", target.columns, target.rows);
  } else if (!all.empty()) {
    none = fmt::format("the tag {} is not found, but {}", target.id, idsOf(all));
  } else {
    none = "no tag of " + target.family + " is found";
    for (const char* family : other_families) {
      Target other = target;
      other.family = family;
      // The small families find tags in noise.
      if (family == target.family || (std::string(family) == "16h5" && target.id < 0)) continue;
      const std::vector<SeenTarget> found = library.findTargets(image, other, lacking);
      if (!found.empty()) return none += fmt::format(", but {} of {}", idsOf(found), family), std::nullopt;
    }
  }
  return std::nullopt;
}

}  // namespace

Target targetFrom(const std::string& text, const std::string& user) {
  const std::vector<std::string> parts = partsOf(text, ':');
  const auto refuse = [&](const std::string& expected) -> OptionError {
    return OptionError(user, "--target " + text, expected);
  };
  const char* forms =
      "april:36h11:0.05 (family and side of the border, m) or chessboard:9x6:0.025 (inner corners and "
      "side of a square, m)";
  Target target;
  if (parts.size() < 3 || parts.size() > 4) throw refuse(forms);
  if (parseNumber(parts[2], target.size) != NumberKind::finite || !(target.size > 0)) {
    throw refuse("a length of more than 0 m in the third place");
  }
  if (parts[0] == "april") {
    target.family = parts[1].rfind("tag", 0) == 0 ? parts[1].substr(3) : parts[1];
    if (parts.size() == 4) {
      const auto id = wholeNumber(parts[3], 99999);
      if (!id) throw refuse("the number of a tag in the fourth place");
      target.id = *id;
    }
    return target;
  }
  if (parts[0] != "chessboard" || parts.size() != 3) throw refuse(forms);
  target.kind = Target::Kind::chessboard;
  const std::vector<std::string> counts = partsOf(parts[1], 'x');
  const auto columns = wholeNumber(counts[0], 100), rows = wholeNumber(counts.size() == 2 ? counts[1] : "", 100);
  if (!columns || !rows || *columns < 3 || *rows < 3) throw refuse("3 to 100 inner corners to each side, as 9x6");
  if ((*columns + *rows) % 2 == 0) {
    throw refuse(
        "an odd number of inner corners along one side and an even one along the other: this board looks the "
        "same after half a turn");
  }
  target.columns = *columns, target.rows = *rows;
  return target;
}

Camera cameraOf(const std::string& calibration, const std::string& name) {
  const std::vector<CameraCalibration> cameras = readCameras(calibration);
  std::string names;
  for (const CameraCalibration& x : cameras) {
    if (x.name == name || (name.empty() && cameras.size() == 1)) return x.camera;
    names += (names.empty() ? "" : ", ") + x.name;
  }
  throw InputError(calibration, 0,
                   name.empty() ? fmt::format("there are {} cameras in it: {}", cameras.size(), names)
                                : fmt::format("there is no camera {} in it, but {}", printable(name), names),
                   "one of them by --camera");
}

std::vector<ImagePose> posesInImages(const std::vector<std::string>& files, const Target& target, const Camera& camera,
                                     const std::string& user) {
  for (const std::string& file : files) {
    std::error_code none;
    if (!std::filesystem::exists(file, none)) throw InputError(file, 0, "there is no such file");
    if (std::filesystem::is_directory(file, none)) throw InputError(file, 0, "it is a folder", "images");
  }
  const ImageLibrary& library = imageLibrary(user);
  const std::unique_ptr<ImageSequence> images = library.openFiles(files);
  std::vector<ImagePose> poses;
  Progress progress(user.substr(user.find(' ') + 1), files.size());
  for (const std::string& file : files) {
    const GreyView image = images->next();
    if (!images->fault().empty()) throw InputError(file, 0, images->fault(), "an image");
    if (camera.width > 0 && (image.width != camera.width || image.height != camera.height)) {
      throw InputError(file, 0, fmt::format("it has {} x {} pixels", image.width, image.height),
                       fmt::format("{} x {}, as the calibration says", camera.width, camera.height));
    }
    ImagePose pose{file, {}, {}};
    if (const auto seen = targetIn(image, file, target, library, user, pose.none)) {
      pose.target = estimateTargetPose(image, camera, target, *seen);
      if (pose.target.result.fault == FaultKind::too_few_points) {
        pose.none = "what is found does not look like the target, or reaches to the border";
      } else if (pose.target.result.fault) {
        pose.none = describe(pose.target.result.fault);
      }
    }
    poses.push_back(std::move(pose));
    progress.advance(1);
  }
  if (std::all_of(poses.begin(), poses.end(), [](const ImagePose& x) { return !x.none.empty(); })) {
    throw InputError(poses[0].image, 0,
                     poses[0].none + (poses.size() > 1 ? fmt::format(", nor in {} more", poses.size() - 1) : ""),
                     "an image of the target");
  }
  return poses;
}

}  // namespace liestat::cli
