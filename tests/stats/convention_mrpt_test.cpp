// MRPT's Gaussian poses are those of the preset mrpt-ypr: composition, inverse and another world agree.
#include <stats/convention_presets.hpp>
#include <stats/propagation.hpp>

#include <support/full_pose.hpp>

#include <gtest/gtest.h>
#include <mrpt/poses/CPose3DPDFGaussian.h>

namespace liestat {
namespace {

using liestat_test::fullGaussian, liestat_test::scaledGap, liestat_test::Matrix6;
using mrpt::poses::CPose3D, mrpt::poses::CPose3DPDFGaussian;

CPose3D poseOf(const SE3d& T) {
  const Eigen::Vector3d p = T.translation(), a = toRollPitchYaw(T.so3());
  return CPose3D(p[0], p[1], p[2], a[2], a[1], a[0]);
}
CPose3DPDFGaussian mrptOf(const Gaussian<SE3d>& g) {
  const Matrix6 C = toConvention(*conventionPreset("mrpt-ypr"), g);
  CPose3DPDFGaussian result(poseOf(g.mean));
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) result.cov(i, j) = C(i, j);
  }
  return result;
}
Gaussian<SE3d> ours(const CPose3DPDFGaussian& m) {
  Matrix6 C;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) C(i, j) = m.cov(i, j);
  }
  const SE3d T(fromRollPitchYaw(m.mean.roll(), m.mean.pitch(), m.mean.yaw()),
               Eigen::Vector3d(m.mean.x(), m.mean.y(), m.mean.z()));
  return fromConvention(*conventionPreset("mrpt-ypr"), T, C);
}

TEST(ConventionMrpt, composesInvertsAndMovesAsWeDo) {
  CounterRng rng(45, 0);
  for (int trial = 0; trial < 20; ++trial) {
    const Gaussian<SE3d> a = fullGaussian(rng, 1e-4), b = fullGaussian(rng, 1e-4);
    const auto agree = [](const CPose3DPDFGaussian& theirs, const Gaussian<SE3d>& expected, const char* what) {
      const Gaussian<SE3d> g = ours(theirs);
      EXPECT_LE((g.mean.matrix() - expected.mean.matrix()).norm(), 1e-13) << what;
      // Angles of the results may come near their pole.
      const double cos_pitch = std::cos(toRollPitchYaw(expected.mean.so3())[1]);
      EXPECT_LE(scaledGap(g.covariance, expected.covariance), 1e-12 / (cos_pitch * cos_pitch)) << what;
    };
    agree(mrptOf(a) + mrptOf(b), compose(a, b), "composition");
    agree(-mrptOf(a), inverse(a), "inverse");
    CPose3DPDFGaussian moved = mrptOf(a);
    moved.changeCoordinatesReference(poseOf(b.mean));
    agree(moved, act(b.mean, a), "another world");
  }
}

}  // namespace
}  // namespace liestat
