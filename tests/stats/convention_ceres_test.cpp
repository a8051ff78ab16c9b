// The covariance that Ceres computes of position and quaternion is that of the preset ceres-quat.
#include <lie/compat/ceres.hpp>
#include <stats/convention_charts.hpp>
#include <stats/convention_presets.hpp>

#include <Eigen/Cholesky>
#include <support/full_pose.hpp>

#include <ceres/ceres.h>
#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace liestat {
namespace {

using liestat_test::fullGaussian, liestat_test::scaledGap, liestat_test::Matrix6, liestat_test::Vector6;

/// The whitened error Log(T_hat⁻¹ T) of a measured pose.
struct MeasuredPose {
  SE3d measured;
  Matrix6 root_information;

  template <class S>
  bool operator()(const S* position, const S* quaternion, S* residual) const {
    const SE3<S> T(SO3<S>(Eigen::Quaternion<S>(quaternion)),
                   Eigen::Matrix<S, 3, 1>(position[0], position[1], position[2]));
    Eigen::Map<Eigen::Matrix<S, 6, 1>> r(residual);
    r = root_information.cast<S>() * (measured.cast<S>().inverse() * T).log();
    return true;
  }
};

TEST(ConventionCeres, covarianceOfPositionAndQuaternion) {
  CounterRng rng(48, 0);
  for (int trial = 0; trial < 3; ++trial) {
    const Gaussian<SE3d> g = fullGaussian(rng, 1e-3);
    const Eigen::LLT<Matrix6> factor(g.covariance);
    const Matrix6 whitening = factor.matrixL().solve(Matrix6::Identity());
    Eigen::Vector3d p = g.mean.translation();
    Eigen::Quaterniond q(g.mean.unit_quaternion());
    ceres::Problem problem;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<MeasuredPose, 6, 3, 4>(new MeasuredPose{g.mean, whitening}), nullptr, p.data(),
        q.coeffs().data());
    problem.SetManifold(q.coeffs().data(), new ceres::EigenQuaternionManifold);
    ceres::Covariance covariance({});
    const std::vector<const double*> blocks = {p.data(), q.coeffs().data()};
    ASSERT_TRUE(covariance.Compute(blocks, &problem));
    Matrix6 theirs;
    ASSERT_TRUE(covariance.GetCovarianceMatrixInTangentSpace(blocks, theirs.data()));
    EXPECT_LE(scaledGap(theirs, toConvention(*conventionPreset("ceres-quat"), g)), 1e-12);
    EXPECT_LE(scaledGap(fromConvention(*conventionPreset("ceres-quat"), g.mean, theirs).covariance, g.covariance),
              1e-12);
  }
}

TEST(ConventionCeres, quaternionManifoldsAreHalfAnglesOfTheWorld) {
  CounterRng rng(49, 0);
  const Convention c = *conventionPreset("ceres-quat");
  const ceres::EigenQuaternionManifold manifold;
  for (int trial = 0; trial < 20; ++trial) {
    const SE3d T_hat = fullGaussian(rng).mean;
    const Eigen::Vector3d d = 0.4 * rng.normalVector<3>();
    Eigen::Quaterniond moved;
    ASSERT_TRUE(manifold.Plus(T_hat.unit_quaternion().coeffs().data(), d.data(), moved.coeffs().data()));
    Vector6 x = Vector6::Zero();
    x.tail<3>() = d;
    EXPECT_LE((conventionExp(c, T_hat, x).rotationMatrix() - moved.toRotationMatrix()).norm(), 1e-14);
  }
}

}  // namespace
}  // namespace liestat
