// Tracks of points in images: those of a camera over time, those of a stereo camera with its poses, matches of two images.
#pragma once

#include <fusion/camera_calibration.hpp>
#include <fusion/stereo.hpp>
#include <formats/numeric_table.hpp>

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace liestat {

/// The tracks that a camera saw over time.
struct ImageTracks {
  std::vector<double> times;                   ///< s since the start that the reader was given, ascending, one an image
  std::vector<std::size_t> frames;             ///< the number of each image in the files
  std::vector<PixelObservation> observations;  ///< by images, then by tracks
  std::vector<std::size_t> track_ids;          ///< the number of each track in the file, ascending
  bool has_sigmas = false;                     ///< each observation has its own
  std::size_t seen_once = 0;                   ///< tracks with one observation, which are of no use but kept
  std::string format;                          ///< the times': euroc, csv (a file frame,t_s), or t_s (a column)
};

/// Reads tracks, CSV with the columns frame, track, u, v (or those of the left of a stereo pair, uL and vL) and, unless
/// there is a file of times, t_s, and where each observation has its own standard deviation sigma (px), as those of
/// `liestat track` have; and the times of the images, CSV with the columns frame and t_s, or EuRoC's
/// cam0/data.csv (timestamp [ns], filename), whose rows are frames 0, 1, ... Frames may begin anywhere and leave some
/// out; with a file of times an image is a row of it, seen into or not. Seconds are those of the clock of `start_ns`:
/// it is subtracted. Throws InputError with the line: a frame and track again, a frame without a time, times that do
/// not ascend, a time that contradicts another of its frame, what is not a finite number, numbers of frames or tracks
/// that are not whole. `image_times` may be empty; `-` is standard input.
ImageTracks readImageTracks(const std::string& tracks, const std::string& image_times, std::int64_t start_ns);
/// The same from memory.
ImageTracks parseImageTracks(std::string_view tracks_text, const std::string& tracks_name, std::string_view times_text,
                             const std::string& times_name, std::int64_t start_ns);

/// The standard deviation of a row of tracks; throws InputError unless it is above 0.
double sigmaOfTrack(const NumericTable& table, std::size_t row, std::size_t column);

/// Where no image is among the readings: which unit the stamps of one of the two files may have, if not nanoseconds, in
/// words. `image_time` is that of an image on the clock that shows start_ns at zero. Empty: no suspicion.
std::string suspectedUnit(std::int64_t start_ns, double image_time);

/// Rows `frame,track,uL,vL,uR,vR`. All four readers throw InputError, and `-` is standard input.
std::vector<StereoObservation> readStereoTracks(const std::string& path);

/// Rows `frame,t_s,R00 ... R22,cx,cy,cz`; each frame once. Rotations are projected to the nearest one.
std::vector<CameraPose> readCameraPoses(const std::string& path);

/// Rows `name,value` with fu, fv, cu, cv, b and, where known, y_var0 to y_var3; other names are passed over.
StereoCamera readStereoCamera(const std::string& path);

/// Rows `x,y,z` in m: row i is the landmark of track i.
std::vector<Eigen::Vector3d> readLandmarks(const std::string& path);

/// Matches of two images.
struct Matches {
  std::vector<Eigen::Vector4d> points;  ///< a point in the first image and in the second, px
  double sigma = 0;                     ///< px: root of the mean of u's and v's variances; 0: not known
  std::size_t left_out = 0;             ///< whose sigma is more than twice the median
};
/// Rows `x1,y1,x2,y2`, or the tracks of two images, `frame,track,u,v` and, where known, `sigma`, as `liestat track` has
/// them: of these, matches that are far less exact than the others are left out, because the estimates of a motion take
/// one noise for all. Throws InputError; `-` is standard input.
Matches readMatches(const std::string& path);

}  // namespace liestat
