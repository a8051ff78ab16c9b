#pragma once

#include <fusion/stereo.hpp>

#include <Eigen/Core>
#include <string>
#include <vector>

namespace liestat {

/// Rows `frame,track,uL,vL,uR,vR`. All four readers throw InputError, and `-` is standard input.
std::vector<StereoObservation> readStereoTracks(const std::string& path);

/// Rows `frame,t_s,R00 ... R22,cx,cy,cz`; each frame once. Rotations are projected to the nearest one.
std::vector<CameraPose> readCameraPoses(const std::string& path);

/// Rows `name,value` with fu, fv, cu, cv, b and, where known, y_var0 to y_var3; other names are passed over.
StereoCamera readStereoCamera(const std::string& path);

/// Rows `x,y,z` in m: row i is the landmark of track i.
std::vector<Eigen::Vector3d> readLandmarks(const std::string& path);

}  // namespace liestat
