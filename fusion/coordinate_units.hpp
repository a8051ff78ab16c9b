// Image coordinates and the camera that they are said to be of: have they the same unit? Estimators of motion refuse
// normalised coordinates with focal lengths in pixels, pixels with focal lengths of one, and focal lengths that leave
// no image.
#pragma once

#include <fusion/camera.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <string>
#include <vector>

namespace liestat {

/// The unit's fault, in words; empty: none.
struct CoordinateFault {
  std::string found, expected;
  explicit operator bool() const { return !found.empty(); }
};

/// Collects image coordinates and where they lie on the camera's plane at unit distance.
class CoordinateUnits {
 public:
  /// A point of the image and the same over the focal length, about the principal point. Points that are not finite are
  /// left out.
  void add(const Eigen::Vector2d& pixel, const Eigen::Vector2d& normalised) {
    if (!pixel.allFinite() || !normalised.allFinite()) return;
    largest_ = std::max(largest_, pixel.cwiseAbs().maxCoeff());
    radii_.push_back(normalised.norm());
  }
  std::size_t size() const { return radii_.size(); }

  /// Fewer than eight points, or points that are all the same one, tell nothing of their unit.
  CoordinateFault fault(const Camera& camera) const {
    if (radii_.size() < min_points) return {};
    // No camera for pixels has an image that is ten pixels wide.
    if (largest_ <= 10 && camera.fu > 50) {
      return {
          "no image coordinate is larger than " + number(largest_) + ", and the focal length is " + number(camera.fu),
          "both in pixels, or both normalised (--intrinsics 1,1,0,0 and --sigma over the focal length)"};
    }
    std::vector<double> radii = radii_;
    const auto middle = radii.begin() + static_cast<std::ptrdiff_t>(radii.size() / 2);
    std::nth_element(radii.begin(), middle, radii.end());
    if (*middle > 10) {
      return {"half of the points lie more than " + number(*middle) + " focal lengths from the principal point",
              "focal lengths (" + number(camera.fu) + ", " + number(camera.fv) + ") and image coordinates in pixels"};
    }
    // A hundredth of the angle that the longest lenses see.
    if (*std::max_element(radii.begin(), radii.end()) < 1e-5 && largest_ > 0) {
      return {"all points lie within 1e-5 focal lengths (" + number(camera.fu) + ") of the principal point",
              "focal lengths in pixels"};
    }
    return {};
  }

 private:
  static constexpr std::size_t min_points = 8;
  static std::string number(double x) {
    char text[32];
    std::snprintf(text, sizeof text, "%.3g", x);
    return text;
  }

  double largest_ = 0;
  std::vector<double> radii_;
};

}  // namespace liestat
