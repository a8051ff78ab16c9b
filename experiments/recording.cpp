#include <experiments/recording.hpp>

#include <lie/manifold.hpp>
#include <lie/so3.hpp>

#include <algorithm>

namespace liestat::experiments {

std::optional<GroundTruth> truthAt(const std::vector<GroundTruth>& truth, double time) {
  const auto next =
      std::lower_bound(truth.begin(), truth.end(), time, [](const GroundTruth& g, double t) { return g.time < t; });
  if (next == truth.end() || (next == truth.begin() && next->time > time)) return std::nullopt;
  if (next->time == time) return *next;
  const GroundTruth& before = *(next - 1);
  const double h = next->time - before.time;
  if (h > 0.1) return std::nullopt;
  const double s = (time - before.time) / h;
  GroundTruth at = before;
  at.time = time;
  at.state = SE23d(interpolate(SO3d(before.state.so3()), SO3d(next->state.so3()), s),
                   Eigen::Vector3d((1 - s) * before.state.translation() + s * next->state.translation()),
                   Eigen::Vector3d((1 - s) * before.state.velocity() + s * next->state.velocity()));
  return at;
}

CameraCalibration defaultCamera() {
  CameraCalibration camera;
  camera.name = "cam0";
  camera.camera = {.fu = 450, .fv = 450, .cu = 376, .cv = 240, .width = 752, .height = 480};
  Eigen::Matrix3d imu_R_cam;
  imu_R_cam << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  camera.imu_T_cam = SE3d(imu_R_cam, Eigen::Vector3d(0.05, 0.02, 0.01));
  return camera;
}

}  // namespace liestat::experiments
