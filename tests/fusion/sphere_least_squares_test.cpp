// Minima on the sphere against dense sampling, in the hard case, and where the matrix loses rank.

#include <fusion/init/sphere_least_squares.hpp>
#include <support/vi_scene.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

namespace {

using namespace liestat;
using Vector3 = Eigen::Vector3d;
using Matrix3 = Eigen::Matrix3d;

Matrix3 someMatrix(CounterRng& random, double spread) {
  Matrix3 R;
  for (int k = 0; k < 3; ++k)
    R.row(k) = std::pow(10., random.uniform(-spread, 0)) * random.normalVector<3>().transpose();
  return R;
}

double cost(const Matrix3& R, const Vector3& r, const Vector3& x) { return (R * x + r).squaredNorm(); }

/// The gradient along the sphere, relative to its parts.
double stationarity(const Matrix3& R, const Vector3& r, const Vector3& x) {
  const Vector3 gradient = R.transpose() * (R * x + r), across = gradient - gradient.dot(x) / x.squaredNorm() * x;
  return across.norm() / (R.norm() * (R.norm() * x.norm() + r.norm()));
}

// Local minima of a sampled sphere: points cheaper than all their neighbours. In a narrow valley a chain of samples
// looks like that, so they are followed downhill, and only where the matrix is not too far from round; the global
// minimum is compared always.
TEST(SphereMinima, AgreeWithDenseSampling) {
  CounterRng random(5);
  constexpr int n = 60;
  int two = 0;
  for (int trial = 0; trial < 150; ++trial) {
    const bool round = trial % 2 == 0;
    const Matrix3 R = someMatrix(random, round ? 0.5 : 2);
    const double radius = random.uniform(0.3, 3);
    const Vector3 r = -R * (radius * random.uniform(0, 2) * random.unitVector<3>()) + 0.1 * random.normalVector<3>();
    const SphereMinima minima = minimiseOnSphere(R, r, radius);
    ASSERT_GE(minima.count, 1);
    EXPECT_LE(minima.cost[0], minima.cost[minima.count - 1]);
    two += minima.count == 2;
    for (int k = 0; k < minima.count; ++k) {
      EXPECT_NEAR(minima.point[k].norm(), radius, 1e-14 * radius);
      EXPECT_LE(stationarity(R, r, minima.point[k]), 1e-11) << trial << " minimum " << k;
      // A minimum: dearer all around.
      for (int j = 0; j < 20; ++j) {
        const Vector3 near = radius * (minima.point[k] + 1e-3 * radius * random.unitVector<3>()).normalized();
        EXPECT_GE(cost(R, r, near), minima.cost[k] * (1 - 1e-12)) << trial << " minimum " << k;
      }
    }
    std::vector<double> sampled(n * 2 * n);
    const auto at = [&](int i, int j) {
      const double a = M_PI * (i + 0.5) / n, b = M_PI * j / n;
      return Vector3(radius * Vector3(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a)));
    };
    const auto index = [](int i, int j) { return static_cast<std::size_t>(2 * n * i + (j + 2 * n) % (2 * n)); };
    double lowest = std::numeric_limits<double>::infinity();
    for (int i = 0; i < n; ++i) {
      for (int j = 0; j < 2 * n; ++j) {
        sampled[index(i, j)] = cost(R, r, at(i, j));
        lowest = std::min(lowest, sampled[index(i, j)]);
      }
    }
    EXPECT_LE(minima.cost[0], lowest * (1 + 1e-12)) << trial;
    // Away from the poles, where the neighbours of a sample are its neighbours on the sphere.
    for (int i = 5; round && i + 5 < n; ++i) {
      for (int j = 0; j < 2 * n; ++j) {
        bool is_lowest = true;
        for (int a = -1; a <= 1; ++a) {
          for (int b = -1; b <= 1; ++b) is_lowest = is_lowest && sampled[index(i, j)] <= sampled[index(i + a, j + b)];
        }
        if (!is_lowest) continue;
        Vector3 x = at(i, j);
        double step = 0.05;
        for (int k = 0; k < 4000 && step > 1e-9; ++k) {
          const Vector3 next = radius * (x + step * radius * random.unitVector<3>()).normalized();
          if (cost(R, r, next) < cost(R, r, x)) {
            x = next;
            step *= 2;
          } else {
            step *= 0.9;
          }
        }
        double gap = (x - minima.point[0]).norm();
        if (minima.count == 2) gap = std::min(gap, (x - minima.point[1]).norm());
        const bool as_cheap = cost(R, r, x) <= minima.cost[minima.count - 1] * (1 + 1e-3);
        EXPECT_TRUE(gap < 0.1 * radius || as_cheap) << trial << ": a minimum that was not found";
      }
    }
  }
  EXPECT_GE(two, 20);
}

TEST(SphereMinima, OfDataWithoutAPreferredSideAreTwo) {
  // Nothing is known along x: both points of the sphere above (0.3, 0.4).
  Matrix3 R = Matrix3::Zero();
  R(1, 1) = 2;
  R(2, 2) = 1;
  const SphereMinima minima = minimiseOnSphere(R, Vector3(0, -0.6, -0.4), 1);
  ASSERT_EQ(minima.count, 2);
  const double x = std::sqrt(1 - 0.25);
  for (int k = 0; k < 2; ++k) {
    EXPECT_LE(minima.cost[k], 1e-30);
    EXPECT_NEAR(std::abs(minima.point[k].x()), x, 1e-15);
    EXPECT_NEAR(minima.point[k].y(), 0.3, 1e-15);
  }
  EXPECT_LT(minima.point[0].x() * minima.point[1].x(), 0);
}

TEST(SphereMinima, KeepTheirDigitsWhereRankIsLostToRounding) {
  // The singular value along a direction is rounding, and so is the data's opinion on it: both minima to 1e-13.
  CounterRng random(6);
  for (int trial = 0; trial < 200; ++trial) {
    Matrix3 R = someMatrix(random, 1);
    const Vector3 null = random.unitVector<3>();
    R -= (R * null) * null.transpose();
    const Vector3 truth = 2 * random.unitVector<3>();
    const double along = truth.dot(null);
    if (std::abs(along) < 0.1) continue;
    const SphereMinima minima = minimiseOnSphere(R, -R * truth, truth.norm());
    ASSERT_EQ(minima.count, 2) << trial;
    const Vector3 mirror = truth - 2 * along * null;
    // The other singular values are 1e-3 and larger.
    const double direct = (minima.point[0] - truth).norm() + (minima.point[1] - mirror).norm();
    const double crossed = (minima.point[1] - truth).norm() + (minima.point[0] - mirror).norm();
    EXPECT_LE(std::min(direct, crossed), 1e-11) << trial;
  }
}

TEST(SphereMinima, OfBadInputAreNone) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(minimiseOnSphere(Matrix3::Constant(nan), Vector3::Ones(), 1).count, 0);
  EXPECT_EQ(minimiseOnSphere(Matrix3::Identity(), Vector3::Constant(nan), 1).count, 0);
  EXPECT_EQ(minimiseOnSphere(Matrix3::Identity(), Vector3::Ones(), 0).count, 0);
  EXPECT_EQ(minimiseOnSphere(Matrix3::Identity(), Vector3::Ones(), nan).count, 0);
  // No data at all: some point of the sphere.
  const SphereMinima none = minimiseOnSphere(Matrix3::Zero(), Vector3::Zero(), 2);
  ASSERT_GE(none.count, 1);
  EXPECT_NEAR(none.point[0].norm(), 2, 1e-15);
}

}  // namespace
