#include <experiments/recording.hpp>

namespace liestat::experiments {

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
