#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace liestat::cli {

/// A landmark in a rectified stereo pair, in pixels.
struct StereoObservation {
  std::size_t frame = 0;
  std::size_t track = 0;
  double uL = 0;
  double vL = 0;
  double uR = 0;
  double vR = 0;
};

/// The pose of the left camera (x right, y down, z forward).
struct CameraPose {
  std::size_t frame = 0;
  double t = 0;                                                  ///< s
  Eigen::Matrix3d R_camera_world = Eigen::Matrix3d::Identity();  ///< takes world to camera coordinates
  Eigen::Vector3d c = Eigen::Vector3d::Zero();                   ///< the camera's centre in the world, m
};

/// A rectified stereo pair.
struct StereoCamera {
  double fu = 0;  ///< focal lengths and principal point, pixels
  double fv = 0;
  double cu = 0;
  double cv = 0;
  double b = 0;                                   ///< baseline, m
  std::optional<Eigen::Vector4d> pixel_variance;  ///< uL, vL, uR, vR; pixels squared, if the file has them
};

/// Rows `frame,track,uL,vL,uR,vR`. All four readers throw InputError, and `-` is standard input.
std::vector<StereoObservation> readStereoTracks(const std::string& path);

/// Rows `frame,t_s,R00 ... R22,cx,cy,cz`; each frame once. Rotations are projected to the nearest one.
std::vector<CameraPose> readCameraPoses(const std::string& path);

/// Rows `name,value` with fu, fv, cu, cv, b and, where known, y_var0 to y_var3; other names are passed over.
StereoCamera readStereoCamera(const std::string& path);

/// Rows `x,y,z` in m: row i is the landmark of track i.
std::vector<Eigen::Vector3d> readLandmarks(const std::string& path);

}  // namespace liestat::cli
