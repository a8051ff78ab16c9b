// Poses of a planar target from images, for the commands that take them.
#pragma once

#include <formats/text.hpp>
#include <fusion/targets/target_pose.hpp>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// An image and the pose of the target in it, or why there is none.
struct ImagePose {
  std::string image;
  std::string none;  ///< why there is no pose; empty: there is one
  TargetPose target;
};
template <class V>
void describe(V& v, const ImagePose& x) {
  v("image", x.image)("none", x.none, "why there is no pose; empty: there is one");
  describe(v, x.target);
}

/// april:36h11:0.05, april:36h11:0.05:7 (the tag 7) or chessboard:9x6:0.025. Throws OptionError in the name of `user`.
Target targetFrom(const std::string& text, const std::string& user);

/// The camera of a calibration, by its name if there are several. Throws InputError.
Camera cameraOf(const std::string& calibration, const std::string& name);

/// Looks for the target in image files, one after another. Throws InputError for an image that can't be read, of another
/// size than the calibration's, or with two targets, and where no image shows one.
std::vector<ImagePose> posesInImages(const std::vector<std::string>& files, const Target& target, const Camera& camera,
                                     const std::string& user);

}  // namespace liestat::cli
