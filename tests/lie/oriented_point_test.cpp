// Points with a direction: parts in memory, the action of rigid motions, and distances that they leave as they are.

#include <lie/oriented_point.hpp>
#include <stats/maha.hpp>
#include <stats/mean.hpp>
#include <stats/uniqueness.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Vector3d;

const double some_eps = 64 * std::numeric_limits<double>::epsilon();

TEST(OrientedPoint, PartsAndTheirViews) {
  OrientedPointd x(Vector3d(1, 2, 3), Vector3d(0, 3, 4));
  EXPECT_EQ(Vector3d(x.position()), Vector3d(1, 2, 3));
  EXPECT_EQ(S2d(x.direction()).params(), S2d(0, 3, 4).params());
  EXPECT_EQ(OrientedPointd(Vector3d(1, 2, 3), S2d(0, 3, 4)).params(), x.params());
  x.position().x() = 7;
  x.direction() = S2d(1, 0, 0);
  EXPECT_EQ(x.data()[0], 7);
  EXPECT_EQ(x.data()[3], 1);
  EXPECT_TRUE(OrientedPointd(Vector3d::Zero(), Vector3d(0, 0, 0)).params().hasNaN());
}

TEST(OrientedPoint, PlanesAndLines) {
  const OrientedPointd x(Vector3d(1, 1, 2), S2d(0, 0, 1));
  EXPECT_NEAR(x.planeDistance(Vector3d(5, 6, -1)), -3, some_eps);
  EXPECT_LE((x.projectOnLine(Vector3d(5, 6, -1)) - Vector3d(1, 1, -1)).norm(), some_eps);
}

TEST(OrientedPoint, RigidMotionsMoveBothAndKeepDistances) {
  const OrientedPointd x(Vector3d(1, 2, 3), Vector3d(0.3, 0.5, -0.8)), y(Vector3d(-1, 0.5, 2), Vector3d(1, -0.2, 0.4));
  const SE3d f(SO3d::exp(Vector3d(0.7, -1.1, 0.4)), Vector3d(10, -20, 30));
  const OrientedPointd moved = act(f, x);
  EXPECT_LE((moved.position() - f * Vector3d(x.position())).norm(), some_eps);
  EXPECT_LE((moved.direction().unit_vector() - f.so3() * x.direction().unit_vector()).norm(), some_eps);
  const double squared =
      (x.position() - y.position()).squaredNorm() + std::pow(distance(S2d(x.direction()), S2d(y.direction())), 2);
  EXPECT_NEAR(std::pow(distance(x, y), 2), squared, some_eps * squared);
  EXPECT_NEAR(distance(moved, act(f, y)), distance(x, y), 64 * some_eps);
}

std::vector<OrientedPointd> samples() {
  std::vector<OrientedPointd> result;
  for (int i = 0; i < 9; ++i) {
    const double a = 0.7 * i, r = 0.2 + 0.02 * i;
    result.push_back(
        {Vector3d(std::cos(a), 0.1 * i, std::sin(2 * a)), Vector3d(r * std::cos(a), 1, r * std::sin(a + 0.3))});
  }
  return result;
}

TEST(OrientedPoint, MeanIsThatOfPositionsAndOfDirections) {
  const auto data = samples();
  std::vector<Vector3d> positions;
  std::vector<S2d> directions;
  for (const auto& x : data) positions.push_back(x.position()), directions.push_back(x.direction());
  const auto result = mean(data);
  const auto direction = mean(directions);
  ASSERT_TRUE(converged(result.status));
  EXPECT_LE((result.mean.position() - mean(positions).mean).norm(), some_eps);
  EXPECT_LE(distance(S2d(result.mean.direction()), direction.mean), 1e-11);
  const auto unique = uniqueness(data, result);
  EXPECT_EQ(unique.unique, Uniqueness::unique);
  EXPECT_NEAR(unique.r_star, uniqueness(directions, direction).r_star, 1e-9);
}

// Covariances that tell the normal from the plane: moved with the data, the fused point moves with them.
TEST(OrientedPoint, FusionIsEquivariant) {
  const SE3d f(SO3d::exp(Vector3d(0.7, -1.1, 0.4)), Vector3d(1, -2, 3));
  std::vector<Gaussian<OrientedPointd>> data, moved;
  Eigen::Matrix<double, 5, 5> S = Eigen::Matrix<double, 5, 1>(0.01, 0.02, 0.3, 0.02, 0.05).asDiagonal();
  S(0, 3) = S(3, 0) = 0.01;
  for (const auto& x : samples()) {
    data.push_back({x, S});
    moved.push_back(act(f, data.back()));
  }
  // Their size has nothing to do with the scatter.
  const MahaOptions<OrientedPointd> untested{.refutation_level = 0};
  const auto fused = maha(data, CovarianceAt::measured, untested);
  const auto fused_moved = maha(moved, CovarianceAt::measured, untested);
  ASSERT_EQ(fused.status, Status::ok);
  ASSERT_EQ(fused_moved.status, Status::ok);
  EXPECT_LE(distance(fused_moved.mean, act(f, fused.mean)), 1e-9);
  const Gaussian<OrientedPointd> there = act(f, fused.estimate());
  // The Hessian of directions is by differences.
  EXPECT_LE((fused_moved.covariance - there.covariance).norm(), 1e-6);
}

}  // namespace
