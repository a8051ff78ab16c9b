// Planar targets in images: their points with the covariance that the image gives them, and their pose.
//
// A detector (fusion/compat/opencv.cpp) says roughly where a target is; its points follow from a fit of the pattern itself
// to the grey values. With c = G(x) the homography from undistorted image coordinates to the pattern's cells,
//
//   grey(u) = b(c) + a(c) · (pattern ∗ Gaussian)(c),
//
// offset b and contrast a linear over the pattern, and the width of the blur (lens and pixel) one number in the image. A
// tag is fitted as a whole: its corners are images of G and have a joint covariance. Of a chessboard each inner corner is
// fitted by itself over half a square to all sides. The variance of the noise is that of the residuals, weighted by the
// pattern's gradient, so that what the model lacks at its edges counts. Scores of 8 × 8 blocks, against what noise
// would give, see what the pattern does not explain (occlusion, a bent sheet, highlights): the covariance is widened by the
// ratio.
#pragma once

#include <fusion/targets/planar_pose.hpp>
#include <fusion/tracking/images.hpp>

#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace liestat {

/// A target. Its axes: x to the right, y down, z away from whoever looks at it.
struct Target {
  enum class Kind {
    chessboard,  ///< `columns` × `rows` inner corners, one of them odd; the first corner is the origin, and the square that
                 ///< has x and y positive beside it is black
    april        ///< a tag of a family; the middle of its border is the origin
  };
  Kind kind = Kind::april;
  int columns = 0, rows = 0;
  std::string family;  ///< 36h11
  double size =
      0;        ///< m: side of a square, or of the tag's border (black outside, but for families of inverted border)
  int id = -1;  ///< of the tag; -1: any, if it is the only one
};

/// A target as a detector sees it.
struct SeenTarget {
  int id = -1;
  /// To some pixels: inner corners row by row; or corners of the border (x, y) = (−, −), (+, −), (+, +), (−, +).
  std::vector<Eigen::Vector2d> pixels;
  /// A tag's cells along a side and along the border's side, and their colours row by row, 0 black and 1 white.
  int side = 0, border = 0;
  std::vector<std::uint8_t> cells;
};

/// The pose of a target in an image.
struct TargetPose {
  PlanarPoseResult result;
  int id = -1;                                              ///< of a tag
  std::size_t points = 0;                                   ///< that were fitted
  std::size_t not_fitted = 0;                               ///< that do not look like the pattern, and are left out
  double sigma = std::numeric_limits<double>::quiet_NaN();  ///< px: root mean square of the points
  double noise = std::numeric_limits<double>::quiet_NaN();  ///< grey values: of a pixel
  double blur = std::numeric_limits<double>::quiet_NaN();   ///< px: of lens and pixel
  double misfit =
      std::numeric_limits<double>::quiet_NaN();  ///< by which covariances are widened, at most; 1: noise alone
};

template <class V>
void describe(V& v, const TargetPose& x) {
  describe(v, x.result);
  v("id", x.id, "of a tag; -1: a chessboard")("points", x.points, "that were fitted");
  v("points_left_out", x.not_fitted, "that do not look like the pattern");
  v("point_sigma", x.sigma, "root mean square of the points' standard deviations", "px");
  v("image_noise", x.noise, "of a pixel, grey values")("blur", x.blur, "of lens and pixel", "px");
  v("misfit", x.misfit, "of the pattern over that of noise, by which covariances are widened");
}

/// The points of a target in an image, in metres and pixels, with their covariance. Empty: it does not look like it.
struct TargetView {
  PlanarView view;
  TargetPose about;  ///< all but the result
};
LIESTAT_FUSION_API TargetView fitTarget(const GreyView& image, const Camera& camera, const Target& target,
                                        const SeenTarget& seen);

/// Their pose; `too_few_points` where the image does not look like the target.
LIESTAT_FUSION_API TargetPose estimateTargetPose(const GreyView& image, const Camera& camera, const Target& target,
                                                 const SeenTarget& seen);

}  // namespace liestat
