#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace liestat::cli {

/// How a lens bends what it sees.
///   none         pinhole
///   radtan       k1, k2 radial and p1, p2 tangential on the plane at depth one (Brown; Kalibr, OpenCV, EuRoC)
///   equidistant  k1 ... k4 on the angle off the axis (Kannala and Brandt; Kalibr, OpenCV's fisheye, TUM-VI)
enum class Distortion { none, radtan, equidistant };

/// A camera: x to the right, y down, z ahead; pixels (u, v) in the same directions.
struct Camera {
  double fu = 0, fv = 0;  ///< focal lengths, pixels
  double cu = 0, cv = 0;  ///< principal point, pixels
  Distortion distortion = Distortion::none;
  Eigen::Vector4d coefficients = Eigen::Vector4d::Zero();
  int width = 0, height = 0;  ///< of the image, pixels; 0: not known

  /// The pixel that sees a point in the camera's axes, whether the image reaches so far or not. None behind the camera
  /// (an equidistant lens sees beyond 90 degrees, up to where its polynomial ends), none where the distortion folds
  /// over: there it maps two directions to one pixel, and is outside of what was calibrated. None for NaN.
  std::optional<Eigen::Vector2d> project(const Eigen::Vector3d& point_in_camera) const;

  /// The unit vector in the camera's axes that project takes to this pixel; none where there is no such.
  std::optional<Eigen::Vector3d> bearing(double u, double v) const;

  /// rad a pixel of noise: how far the bearing turns, as the geometric mean over the two directions across it. NaN
  /// where there is no bearing.
  double bearingDeviation(double u, double v) const;

  /// Is the pixel within the image? True where its size is not known.
  bool sees(const Eigen::Vector2d& pixel) const;
};

/// A pinhole camera of fu, fv, cu, cv, as --intrinsics gives them. Throws InputError where these are not four finite
/// numbers, the first two of them positive.
Camera cameraFromIntrinsics(const std::vector<double>& intrinsics);

}  // namespace liestat::cli
