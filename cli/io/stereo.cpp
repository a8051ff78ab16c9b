#include <cli/io/stereo.hpp>

#include <algorithm>
#include <map>
#include <unordered_map>

namespace liestat::cli {

std::optional<MeasuredPoint> triangulate(const StereoCamera& camera, const StereoObservation& observation,
                                         double min_disparity) {
  eigen_assert(camera.pixel_variance.has_value());
  const Eigen::Vector4d variance = camera.pixel_variance.value_or(Eigen::Vector4d::Ones());
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

MeasuredPoint toWorld(const CameraPose& pose, const MeasuredPoint& in_camera) {
  const Eigen::Matrix3d R_world_camera = pose.R_camera_world.transpose();
  return {R_world_camera * in_camera.mean + pose.c, R_world_camera * in_camera.covariance * R_world_camera.transpose()};
}

std::vector<LandmarkMeasurements> backProject(const std::vector<StereoObservation>& observations,
                                              const std::vector<CameraPose>& poses, const StereoCamera& camera,
                                              double min_disparity) {
  std::unordered_map<std::size_t, const CameraPose*> pose_of;
  for (const CameraPose& pose : poses) pose_of.emplace(pose.frame, &pose);

  std::vector<StereoObservation> ordered = observations;
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

}  // namespace liestat::cli
