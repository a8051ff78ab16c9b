#pragma once

#include <stats/gaussian.hpp>

#include <lie/rn.hpp>

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <vector>

#include <cli/io/tracks.hpp>

namespace liestat::cli {

/// A point of R^3 with the covariance of its error, m.
using MeasuredPoint = Gaussian<Eigen::Vector3d>;

/// The point that a rectified stereo pair sees, in the coordinates of the left camera: depth fu·b/disparity, and the
/// two rows averaged by their variances. The covariance is the pixels', through the derivative of that (first order,
/// which holds as long as the disparity is many of its standard deviations). The camera must have pixel variances.
/// Empty where the disparity is below `min_disparity` px.
std::optional<MeasuredPoint> triangulate(const StereoCamera& camera, const StereoObservation& observation,
                                         double min_disparity = 1);

/// A point in camera coordinates, put into the world by a pose that is taken as exact.
MeasuredPoint toWorld(const CameraPose& pose, const MeasuredPoint& in_camera);

/// All that was seen of one landmark, in the order of the frames.
struct LandmarkMeasurements {
  std::size_t track = 0;
  std::vector<MeasuredPoint> points;  ///< in the world
  std::vector<std::size_t> frames;    ///< in which they were seen
  std::vector<double> times;          ///< the times of those frames, s
};

/// Every observation put into the world, sorted by track; tracks without a usable observation are left out, as are
/// observations in frames without a pose and those of too small a disparity.
std::vector<LandmarkMeasurements> backProject(const std::vector<StereoObservation>& observations,
                                              const std::vector<CameraPose>& poses, const StereoCamera& camera,
                                              double min_disparity = 1);

}  // namespace liestat::cli
