// SE_2(3): what it shares with SE(3), its parts in memory, its mean, and the motion that it describes.

#include <lie/se23.hpp>
#include <stats/group_mean.hpp>
#include <stats/maha.hpp>

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace {

using namespace liestat;
using Vector9 = Eigen::Matrix<double, 9, 1>;

const double some_eps = 64 * std::numeric_limits<double>::epsilon();

Vector9 tangent(double scale, int seed) {
  Vector9 v;
  for (int i = 0; i < 9; ++i) v[i] = scale * (((i * 7 + seed * 5) % 11) - 5.0) / 5;
  return v;
}

TEST(SE23, ThePoseIsThatOfSE3) {
  const Vector9 v = tangent(1, 1), w = tangent(0.7, 2);
  const SE23d x = SE23d::exp(v), y = SE23d::exp(w);
  const SE3d pose = SE3d::exp(v.head<6>());
  EXPECT_LE((SE3d(x.pose()).params() - pose.params()).norm(), some_eps);
  EXPECT_LE((SE3d((x * y).pose()).params() - (pose * SE3d::exp(w.head<6>())).params()).norm(), some_eps);
  EXPECT_LE((x.matrix().topLeftCorner<4, 4>() - pose.matrix()).norm(), some_eps);
  EXPECT_LE((x.Adj().topLeftCorner<6, 6>() - pose.Adj()).norm(), some_eps);
  EXPECT_LE((SE23d::leftJacobian(v).topLeftCorner<6, 6>() - SE3d::leftJacobian(v.head<6>())).norm(), some_eps);
  EXPECT_LE((x.log().head<6>() - pose.log()).norm(), some_eps);
  const Eigen::Vector3d point(1, 2, 3);
  EXPECT_LE((x * point - pose * point).norm(), some_eps) << "a point does not feel the velocity";
}

// Under a constant angular velocity ω and a constant specific force f, both in the body, the rotation is Exp(ωt), the
// velocity R(0) ∫ Exp(ωs) f ds: the velocity part of Exp(0, ωt, f t).
TEST(SE23, TheVelocityIntegratesAConstantForceInTheBody) {
  const Eigen::Vector3d omega(0.3, -1.1, 0.8), force(0.5, 2, -9.8);
  const double t = 1.7;
  Vector9 v;
  v << Eigen::Vector3d::Zero(), t * omega, t * force;
  const int steps = 2000;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  // Midpoints: the error is some (t/steps)² |ω|² |f| t/24.
  for (int k = 0; k < steps; ++k) sum += SO3d::exp((k + 0.5) * t / steps * omega) * force * (t / steps);
  EXPECT_LE((SE23d::exp(v).velocity() - sum).norm(), 1e-6);
}

TEST(SE23, ConstructorsAgree) {
  const SO3d R = SO3d::exp(Eigen::Vector3d(0.3, 0.2, -1));
  const Eigen::Vector3d p(1, 2, 3), v(-4, 5, 6);
  const SE23d x(R, p, v);
  EXPECT_EQ(SE23d(SE3d(R, p), v).params(), x.params());
  EXPECT_LE((SE23d(R.unit_quaternion(), p, v).params() - x.params()).norm(), some_eps);
  EXPECT_LE((SE23d(R.matrix(), p, v).params() - x.params()).norm(), some_eps);
  EXPECT_LE((SE23d(x.matrix()).params() - x.params()).norm(), some_eps);
  EXPECT_EQ(SO3d(x.so3()).params(), R.params());
  EXPECT_EQ(Eigen::Vector3d(x.translation()), p);
  EXPECT_EQ(Eigen::Vector3d(x.velocity()), v);
}

TEST(SE23, ViewsOfPartsWriteThrough) {
  SE23d x;
  x.pose() = SE3d(SO3d::rotX(0.5), Eigen::Vector3d(1, 2, 3));
  x.velocity() << 4, 5, 6;
  EXPECT_EQ(x.data()[4], 1);
  EXPECT_EQ(x.data()[9], 6);
  double memory[10] = {0, 0, 0, 1, 0, 0, 0, 0, 0, 0};
  Eigen::Map<SE23d> view(memory);
  view.velocity().x() = 7;
  view.so3() = SO3d::rotZ(1);
  view.translation().y() = 8;
  EXPECT_EQ(memory[7], 7);
  EXPECT_EQ(memory[5], 8);
  EXPECT_EQ(memory[2], SO3d::rotZ(1).data()[2]);
}

TEST(SE23, GroupMeanIsTheBarycentre) {
  const SE23d centre = SE23d::exp(tangent(0.8, 3)), moved = SE23d::exp(tangent(1.1, 4));
  std::vector<SE23d> samples, from_left, from_right;
  for (int i = 0; i < 12; ++i) {
    samples.push_back(centre * SE23d::exp(tangent(0.3, i)));
    from_left.push_back(moved * samples.back());
    from_right.push_back(samples.back() * moved);
  }
  const auto result = groupMean(samples);
  ASSERT_TRUE(converged(result.status));
  Vector9 sum = Vector9::Zero();
  for (const SE23d& x : samples) sum += (result.mean.inverse() * x).log();
  EXPECT_LE(sum.norm(), 12 * 1e-11);
  EXPECT_LE(log(groupMean(from_left).mean, moved * result.mean).norm(), 1e-11);
  EXPECT_LE(log(groupMean(from_right).mean, result.mean * moved).norm(), 1e-11);
}

// Two estimates of equal covariance: the fused one is midway and the covariance halves, to first order in their gap.
TEST(SE23, FusionOfTwoLiesBetweenThem) {
  const SE23d x = SE23d::exp(tangent(0.8, 3));
  const Vector9 d = tangent(1e-3, 5);
  const Eigen::Matrix<double, 9, 9> S = 1e-4 * Eigen::Matrix<double, 9, 9>::Identity();
  const std::vector<Gaussian<SE23d>> two = {{x * SE23d::exp(d), S}, {x * SE23d::exp(-d), S}};
  const Gaussian<SE23d> fused = fuse(two);
  EXPECT_LE(log(x, fused.mean).norm(), d.squaredNorm());
  EXPECT_LE((2 * fused.covariance - S).norm(), d.norm() * S.norm());
}

}  // namespace
