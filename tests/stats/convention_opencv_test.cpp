// OpenCV's rotation vectors and the Jacobian of its projection are those of the preset opencv-rvec.
#include <stats/convention_charts.hpp>
#include <stats/convention_presets.hpp>

#include <support/full_pose.hpp>

#include <gtest/gtest.h>
#include <opencv2/calib3d.hpp>

#include <vector>

namespace liestat {
namespace {

using liestat_test::fullGaussian, liestat_test::scaledGap, liestat_test::Matrix6, liestat_test::Vector6;

/// Images of points by a camera of focal length 500, one column each.
Eigen::Matrix2Xd images(const SE3d& camera_T_world, const Eigen::Matrix3Xd& points) {
  Eigen::Matrix2Xd result(2, points.cols());
  for (Eigen::Index k = 0; k < points.cols(); ++k) {
    const Eigen::Vector3d x = camera_T_world * Eigen::Vector3d(points.col(k));
    result.col(k) = 500 * x.head<2>() / x[2];
  }
  return result;
}

TEST(ConventionOpenCv, normalEquationsAreOurInformation) {
  CounterRng rng(46, 0);
  for (int trial = 0; trial < 5; ++trial) {
    const SE3d camera_T_world(fullGaussian(rng).mean.so3(), Eigen::Vector3d(0.3, -0.2, 6));
    Eigen::Matrix3Xd points(3, 20);
    std::vector<cv::Point3d> cv_points;
    for (Eigen::Index k = 0; k < 20; ++k) {
      points.col(k) = rng.normalVector<3>();
      cv_points.emplace_back(points(0, k), points(1, k), points(2, k));
    }
    const Eigen::Vector3d r = camera_T_world.so3().log(), t = camera_T_world.translation();
    cv::Mat jacobian, K = (cv::Mat_<double>(3, 3) << 500, 0, 0, 0, 500, 0, 0, 0, 1);
    std::vector<cv::Point2d> seen;
    cv::projectPoints(cv_points, cv::Vec3d(r[0], r[1], r[2]), cv::Vec3d(t[0], t[1], t[2]), K, cv::noArray(), seen,
                      jacobian);
    // The first six columns: rotation vector, translation.
    Eigen::Matrix<double, 40, 6> theirs, ours;
    for (int i = 0; i < 40; ++i) {
      for (int j = 0; j < 6; ++j) theirs(i, j) = jacobian.at<double>(i, j);
    }
    for (int j = 0; j < 6; ++j) {
      const Vector6 d = 1e-4 * Vector6::Unit(j);
      const auto odd = [&](double k) {
        return Eigen::Matrix2Xd(images(camera_T_world * SE3d::exp(k * d), points) -
                                images(camera_T_world * SE3d::exp(-k * d), points));
      };
      const Eigen::Matrix2Xd column = (8 * odd(1) - odd(2)) / (12 * 1e-4);
      ours.col(j) = Eigen::Map<const Eigen::Matrix<double, 40, 1>>(column.data());
    }
    Convention rvec = *conventionPreset("opencv-rvec");
    rvec.content = CovarianceContent::information;
    const Matrix6 sigma = fromConvention(rvec, camera_T_world, theirs.transpose() * theirs).covariance;
    EXPECT_LE(scaledGap(sigma, (ours.transpose() * ours).inverse()), 1e-7) << "differences of 1e-9";
  }
}

TEST(ConventionOpenCv, rotationVectorsAreOurs) {
  CounterRng rng(47, 0);
  const Convention rvec = *conventionPreset("opencv-rvec");
  for (int trial = 0; trial < 20; ++trial) {
    const SE3d T_hat = fullGaussian(rng).mean, T = T_hat * SE3d::exp(0.2 * rng.normalVector<6>());
    const auto vectorOf = [](const SE3d& pose) {
      const Eigen::Matrix3d R = pose.rotationMatrix();
      cv::Matx33d matrix;
      for (int i = 0; i < 9; ++i) matrix.val[i] = R(i / 3, i % 3);
      cv::Vec3d v;
      cv::Rodrigues(matrix, v);
      return Eigen::Vector3d(v[0], v[1], v[2]);
    };
    Vector6 expected;
    expected << vectorOf(T) - vectorOf(T_hat), T.translation() - T_hat.translation();
    EXPECT_LE((conventionLog(rvec, T_hat, T) - expected).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace liestat
