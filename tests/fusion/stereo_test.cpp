#include <fusion/stereo.hpp>

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include <vector>

namespace liestat {
namespace {

const StereoCamera camera{500, 510, 320, 240, 0.25, Eigen::Vector4d(1, 4, 2, 3)};

/// The pair's observation of a point in camera coordinates.
StereoObservation project(const Eigen::Vector3d& p) {
  const double u = camera.fu * p.x() / p.z() + camera.cu, v = camera.fv * p.y() / p.z() + camera.cv;
  return {0, 0, u, v, u - camera.fu * camera.b / p.z(), v};
}

TEST(Stereo, TriangulationInvertsTheProjection) {
  for (const Eigen::Vector3d& p :
       {Eigen::Vector3d(0.3, -0.4, 2), Eigen::Vector3d(-3, 1, 12), Eigen::Vector3d(0, 0, 1)}) {
    const auto point = triangulate(camera, project(p));
    ASSERT_TRUE(point.has_value());
    EXPECT_LT((point->mean - p).norm(), 1e-12 * p.norm());
  }
}

TEST(Stereo, CovarianceIsThatOfThePixelsThroughTheDerivative) {
  const StereoObservation seen = project({0.7, -0.5, 3});
  Eigen::Matrix<double, 3, 4> J;
  const double h = 1e-4;  // px; central differences leave h² ~ 1e-8 relative
  for (int i = 0; i < 4; ++i) {
    const auto moved = [&](double by) {
      StereoObservation o = seen;
      (i == 0 ? o.uL : i == 1 ? o.vL : i == 2 ? o.uR : o.vR) += by;
      return triangulate(camera, o)->mean;
    };
    J.col(i) = (moved(h) - moved(-h)) / (2 * h);
  }
  const Eigen::Matrix3d expected = J * camera.pixel_variance->asDiagonal() * J.transpose();
  EXPECT_LT((triangulate(camera, seen)->covariance - expected).norm(), 1e-7 * expected.norm());
}

TEST(Stereo, SmallDisparitiesAreLeftOut) {
  StereoObservation o{0, 0, 320, 240, 319.5, 240};
  EXPECT_FALSE(triangulate(camera, o).has_value());
  EXPECT_TRUE(triangulate(camera, o, 0.5).has_value());
  o.uR = 321;
  EXPECT_FALSE(triangulate(camera, o).has_value());
  StereoCamera unknown = camera;
  unknown.pixel_variance.reset();
  EXPECT_FALSE(triangulate(unknown, {0, 0, 320, 240, 300, 240}).has_value()) << "no noise, no covariance";
}

TEST(Stereo, BackProjectionSortsByTrackAndFrame) {
  CameraPose first, second;
  first.frame = 4, first.t = 0.4;
  second.frame = 5, second.t = 0.5;
  second.R_camera_world = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()).toRotationMatrix();
  second.c = {1, 2, 3};
  const Eigen::Vector3d world(0.5, 0.2, 6);
  const auto seen = [&](const CameraPose& pose, std::size_t track) {
    StereoObservation o = project(pose.R_camera_world * (world - pose.c));
    o.frame = pose.frame, o.track = track;
    return o;
  };
  StereoObservation without_pose = seen(first, 2);
  without_pose.frame = 9;
  const auto landmarks = backProject(std::vector{seen(second, 7), seen(first, 7), seen(second, 2), without_pose},
                                     std::vector{first, second}, camera);
  ASSERT_EQ(landmarks.size(), 2U);
  EXPECT_EQ(landmarks[0].track, 2U);
  EXPECT_EQ(landmarks[0].points.size(), 1U);
  EXPECT_EQ(landmarks[1].track, 7U);
  EXPECT_EQ(landmarks[1].frames, (std::vector<std::size_t>{4, 5}));
  EXPECT_EQ(landmarks[1].times, (std::vector<double>{0.4, 0.5}));
  for (const auto& point : landmarks[1].points) EXPECT_LT((point.mean - world).norm(), 1e-12);
}

}  // namespace
}  // namespace liestat
