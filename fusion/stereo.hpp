// A rectified stereo pair: points with covariances from what it sees, and landmarks from the tracks of a recording.
#pragma once

#include <lie/rn.hpp>
#include <stats/gaussian.hpp>

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <span>
#include <unordered_map>
#include <utility>
#include <vector>

namespace liestat {

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

/// A point of R^3 with the covariance of its error, m.
using MeasuredPoint = Gaussian<Eigen::Vector3d>;

/// The point that a rectified stereo pair sees, in the coordinates of the left camera: depth fu·b/disparity, and the
/// two rows averaged by their variances. The covariance is the pixels', through the derivative of that (first order,
/// which holds as long as the disparity is many of its standard deviations). Empty without pixel variances, and where
/// the disparity is below `min_disparity` px.
inline std::optional<MeasuredPoint> triangulate(const StereoCamera& camera, const StereoObservation& observation,
                                                double min_disparity = 1) {
  if (!camera.pixel_variance) return std::nullopt;
  const Eigen::Vector4d& variance = *camera.pixel_variance;
  const double disparity = observation.uL - observation.uR;
  if (!(disparity >= min_disparity)) return std::nullopt;
  const double depth = camera.fu * camera.b / disparity;
  const double share = variance[3] / (variance[1] + variance[3]);  // weight of the left row
  const double x = (observation.uL - camera.cu) / camera.fu;
  const double y = (share * observation.vL + (1 - share) * observation.vR - camera.cv) / camera.fv;
  const Eigen::Vector3d ray(x, y, 1);

  // By uL, vL, uR, vR. The depth's derivative by the disparity is -depth/disparity.
  Eigen::Matrix<double, 3, 4> J;
  J.col(0) = -depth / disparity * ray + depth / camera.fu * Eigen::Vector3d::UnitX();
  J.col(1) = share * depth / camera.fv * Eigen::Vector3d::UnitY();
  J.col(2) = depth / disparity * ray;
  J.col(3) = (1 - share) * depth / camera.fv * Eigen::Vector3d::UnitY();
  return MeasuredPoint{depth * ray, J * variance.asDiagonal() * J.transpose()};
}

/// A point in camera coordinates, put into the world by a pose that is taken as exact.
inline MeasuredPoint toWorld(const CameraPose& pose, const MeasuredPoint& in_camera) {
  const Eigen::Matrix3d R_world_camera = pose.R_camera_world.transpose();
  return {R_world_camera * in_camera.mean + pose.c, R_world_camera * in_camera.covariance * R_world_camera.transpose()};
}

/// All that was seen of one landmark, in the order of the frames.
struct LandmarkMeasurements {
  std::size_t track = 0;
  std::vector<MeasuredPoint> points;  ///< in the world
  std::vector<std::size_t> frames;    ///< in which they were seen
  std::vector<double> times;          ///< the times of those frames, s
};

/// Every observation put into the world, sorted by track; tracks without a usable observation are left out, as are
/// observations in frames without a pose and those of too small a disparity.
inline std::vector<LandmarkMeasurements> backProject(std::span<const StereoObservation> observations,
                                                     std::span<const CameraPose> poses, const StereoCamera& camera,
                                                     double min_disparity = 1) {
  std::unordered_map<std::size_t, const CameraPose*> pose_of;
  for (const CameraPose& pose : poses) pose_of.emplace(pose.frame, &pose);

  std::vector<StereoObservation> ordered(observations.begin(), observations.end());
  std::stable_sort(ordered.begin(), ordered.end(),
                   [](const StereoObservation& a, const StereoObservation& b) { return a.frame < b.frame; });
  std::map<std::size_t, LandmarkMeasurements> by_track;
  for (const StereoObservation& observation : ordered) {
    const auto pose = pose_of.find(observation.frame);
    if (pose == pose_of.end()) continue;
    const std::optional<MeasuredPoint> point = triangulate(camera, observation, min_disparity);
    if (!point) continue;
    LandmarkMeasurements& landmark = by_track[observation.track];
    landmark.track = observation.track;
    landmark.points.push_back(toWorld(*pose->second, *point));
    landmark.frames.push_back(observation.frame);
    landmark.times.push_back(pose->second->t);
  }
  std::vector<LandmarkMeasurements> landmarks;
  landmarks.reserve(by_track.size());
  for (auto& entry : by_track) landmarks.push_back(std::move(entry.second));
  return landmarks;
}

}  // namespace liestat
