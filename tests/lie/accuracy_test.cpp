// Accuracy of exp, log and the Jacobians at every decade of the angle, against references in 50 digits.
//
// The measure: Frobenius norm of the error, for a tangent whose translation has norm one, relative where the result is
// larger than one; the reference is evaluated at the rounded input. The bar: 4e-15, for inverse Jacobians 6e-15, and
// 2e-6 in float. The worst errors are printed.

#include <support/accuracy_bar.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace {

using namespace liestat_test;

template <class S>
void checkAll(const std::vector<double>& angles) {
  Table so2, so3, se2, se3, s2, frame2, frame3;
  sweepGroup<liestat::SO2<S>>(so2, angles, 0);
  sweepGroup<liestat::SO3<S>>(so3, angles, 0);
  sweepGroup<liestat::SE2<S>>(se2, angles, 2);
  sweepGroup<liestat::SE3<S>>(se3, angles, 3);
  sweepManifold<liestat::S2<S>>(s2, angles, 0);
  sweepManifold<liestat::Frame2<S>>(frame2, angles, 2);
  sweepManifold<liestat::Frame3<S>>(frame3, angles, 3);
  expectWithinBar<S>("SO2", so2);
  expectWithinBar<S>("SO3", so3);
  expectWithinBar<S>("SE2", se2);
  expectWithinBar<S>("SE3", se3);
  expectWithinBar<S>("S2", s2);
  expectWithinBar<S>("Frame2", frame2);
  expectWithinBar<S>("Frame3", frame3);
}

TEST(Accuracy, DoubleAtEveryDecade) { checkAll<double>(sweptAngles<double>()); }
TEST(Accuracy, DoubleAtPi) { checkAll<double>({EIGEN_PI}); }
TEST(Accuracy, FloatAtEveryDecade) { checkAll<float>(sweptAngles<float>()); }
// float's pi is larger than pi: the logarithm is that of the rotation beyond the half-turn.
TEST(Accuracy, FloatAtItsPi) { checkAll<float>({EIGEN_PI}); }

TEST(Accuracy, LogOfEitherSignOfTheQuaternion) {
  Worst worst;
  for (const double angle : sweptAngles<double>()) {
    for (const auto& v : tangents<double, 3>(angle, 0)) {
      const liestat::SO3d x = liestat::SO3d::exp(v), minus = liestat::SO3d::fromParams(-x.params());
      worst.see(error(minus.log(), referenceLog(x)), angle);
    }
  }
  EXPECT_LE(worst.error, 4e-15) << "at angle " << worst.angle;
}

TEST(Accuracy, LogDoesNotDependOnTheNormOfTheQuaternion) {
  Worst worst;
  for (const double angle : sweptAngles<double>()) {
    for (const auto& v : tangents<double, 3>(angle, 0)) {
      for (const double scale : {1e-3, 0.7, 1 + 1e-7, 3.0, 1e3}) {
        const liestat::SO3d x = liestat::SO3d::fromParams(scale * liestat::SO3d::exp(v).params());
        worst.see(error(x.log(), referenceLog(x)), angle);
      }
    }
  }
  EXPECT_LE(worst.error, 4e-15) << "at angle " << worst.angle;
}

// A rotation matrix near a half-turn says the axis in its symmetric part alone; the trace says nothing of the axis.
TEST(Accuracy, RotationMatricesToQuaternions) {
  Worst worst;
  for (const double angle : sweptAngles<double>()) {
    for (const auto& v : tangents<double, 3>(angle, 0)) {
      const Matrix R = series(crossMatrix({v[0], v[1], v[2]}), 0);
      Eigen::Matrix3d rounded;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) rounded(i, j) = static_cast<double>(R.at(i, j));
      }
      const liestat::SO3d x(rounded);
      const Matrix q = quaternionExp(Matrix(v), 0);
      Eigen::Vector4d params = x.params();
      // Either sign is the rotation; at a half-turn neither is preferred.
      Real dot = 0;
      for (int i = 0; i < 4; ++i) dot += q.a[static_cast<std::size_t>(i)] * params[i];
      if (dot < 0) params = -params;
      worst.see(error(params, q), angle);
    }
  }
  // The rounded matrix itself is off by up to 2e-16 in each of nine entries.
  EXPECT_LE(worst.error, 4e-15) << "at angle " << worst.angle;
}

// Ten thousand products without normalisation. Each product turns by at most 4 eps and stretches by at most 4 eps.
TEST(Accuracy, LongChainsOfProducts) {
  const int n = 10000;
  const double eps = std::numeric_limits<double>::epsilon();
  std::mt19937 generator(11);
  const auto draw = [&] { return static_cast<double>(generator()) * 0x1p-31 - 1; };
  liestat::SO3d x;
  liestat::SO3f x_float;
  Matrix q = column({0, 0, 0, 1});
  for (int i = 0; i < n; ++i) {
    const liestat::SO3d step = liestat::SO3d::exp(Eigen::Vector3d(draw(), draw(), draw()));
    x *= step;
    x_float *= step.cast<float>();
    const Matrix s(step.params());
    // Left multiplication by q.
    Matrix L(4, 4);
    const Real &a = q.a[0], &b = q.a[1], &c = q.a[2], &w = q.a[3];
    L.a = {w, -c, b, a, c, w, -a, b, -b, a, w, c, -a, -b, -c, w};
    q = L * s;
  }
  EXPECT_LE(std::abs(x.params().norm() - 1), 4 * eps * n);
  EXPECT_LE(error(x.log(), column(quaternionLog(q))), 4 * eps * n);
  // float renormalises to first order in every product.
  EXPECT_LE(std::abs(x_float.params().norm() - 1), 4 * std::numeric_limits<float>::epsilon());
  x.normalize();
  EXPECT_LE(std::abs(x.params().norm() - 1), eps);
}

// The choice among representatives: the angle of the nearest, and the gap, to the last digits also at small angles.
TEST(Accuracy, QuotientAnglesAtEveryDecade) {
  for (const double angle : sweptAngles<double>()) {
    if (angle > 0.7) continue;
    for (const auto& v : tangents<double, 6>(angle, 3)) {
      const liestat::NonOrientedFrame3d x = liestat::ManifoldTraits<liestat::NonOrientedFrame3d>::expOrigin(v);
      for (const int i : {0, 1, 2, 3}) {
        using T = liestat::ManifoldTraits<liestat::NonOrientedFrame3d>;
        const auto choice = T::nearestRepresentative(T::representative(x, i));
        const double exact = v.tail<3>().norm();
        EXPECT_LE(std::abs(choice.angle - exact), 8 * std::numeric_limits<double>::epsilon() * exact) << angle;
        EXPECT_EQ(choice.index, i) << "half-turns are their own inverses";
        // Second best: half-turn times a rotation by the angle about v, about the axis where |v| is largest.
        const double largest = v.tail<3>().cwiseAbs().maxCoeff() / (exact > 0 ? exact : 1);
        EXPECT_NEAR(choice.second_angle, 2 * std::acos(largest * std::sin(exact / 2)), 1e-14);
      }
    }
  }
}

}  // namespace
