// Relative poses up to scale: the essential matrix and its derivative, epipolar residuals, the way back from a matrix,
// cheirality, and what the twisted pair is on the manifold.

#include <lie/essential.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace {

using namespace liestat;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using T = ManifoldTraits<Essentiald>;
using Tangent = T::Tangent;
using Vector9 = Eigen::Matrix<double, 9, 1>;

const double eps = std::numeric_limits<double>::epsilon();

class EssentialTest : public testing::Test {
 protected:
  double draw() { return static_cast<double>(generator_()) * 0x1p-31 - 1; }
  Vector3d vector() { return Vector3d(draw(), draw(), draw()); }
  Essentiald pose() { return Essentiald(SO3d::exp(2 * vector()), vector()); }

 private:
  std::mt19937 generator_{5};
};

Vector9 columns(const Matrix3d& E) { return Eigen::Map<const Vector9>(E.data()); }

TEST_F(EssentialTest, FromAndToRigidMotions) {
  const SE3d a_T_b(SO3d::exp(vector()), Vector3d(3, -4, 12));
  const Essentiald x(a_T_b);
  EXPECT_LE((x.se3(13).matrix() - a_T_b.matrix()).norm(), 32 * eps);
  EXPECT_EQ(SO3d(x.so3()).params(), SO3d(a_T_b.so3()).params());
  const Matrix3d E = detail::skew(a_T_b.translation() / 13) * a_T_b.rotationMatrix();
  EXPECT_LE((x.essentialMatrix() - E).norm(), 8 * eps);
  // The storage is that of a rigid motion with a translation of norm one.
  EXPECT_EQ((Eigen::Map<const SE3d>(x.data()).params()), x.se3(1).params());
  EXPECT_TRUE(Essentiald(SE3d()).params().hasNaN()) << "without a translation there is no essential matrix";
}

// x_a is R x_b + t up to its length: the three lie in a plane.
TEST_F(EssentialTest, BearingsOfOnePointHaveNoResidual) {
  for (int i = 0; i < 20; ++i) {
    const SE3d a_T_b(SO3d::exp(2 * vector()), vector());
    const Vector3d in_b = 3 * vector();
    const auto r = Essentiald(a_T_b).epipolarResidual((a_T_b * in_b).normalized(), in_b.normalized());
    EXPECT_LE(std::abs(r.value), 8 * eps);
  }
}

// Central differences of fourth order with a step of 1e-3: truncation 1e-12, rounding some 1e-13.
template <class F>
Eigen::MatrixXd differences(int inputs, const F& f) {
  const double h = 1e-3;
  Eigen::MatrixXd J;
  for (int k = 0; k < inputs; ++k) {
    const Eigen::VectorXd e = h * Eigen::VectorXd::Unit(inputs, k);
    const Eigen::VectorXd column = (8 * (f(e) - f(-e)) - (f(2 * e) - f(-2 * e))) / (12 * h);
    if (k == 0) J.resize(column.size(), inputs);
    J.col(k) = column;
  }
  return J;
}

TEST_F(EssentialTest, DerivativesAgreeWithDifferences) {
  for (int i = 0; i < 20; ++i) {
    const Essentiald x = pose();
    const Vector3d a = vector(), b = vector();
    const auto at = [&](const Eigen::VectorXd& v) { return exp(x, Tangent(v)); };
    const Eigen::MatrixXd J =
        differences(5, [&](const auto& v) { return Eigen::VectorXd(columns(at(v).essentialMatrix())); });
    EXPECT_LE((x.essentialMatrixJacobian() - J).norm(), 1e-10);
    const auto r = x.epipolarResidual(a, b);
    EXPECT_NEAR(r.value, a.dot(x.essentialMatrix() * b), 8 * eps);
    const auto value = [&](const Essentiald& y, const Vector3d& p, const Vector3d& q) {
      return Eigen::VectorXd(Eigen::VectorXd::Constant(1, y.epipolarResidual(p, q).value));
    };
    EXPECT_LE((r.by_pose - differences(5, [&](const auto& v) { return value(at(v), a, b); })).norm(), 1e-10);
    EXPECT_LE((r.by_a - differences(3, [&](const auto& v) { return value(x, a + v, b); })).norm(), 1e-10);
    EXPECT_LE((r.by_b - differences(3, [&](const auto& v) { return value(x, a, b + v); })).norm(), 1e-10);
    // The residual is linear in E: its derivative is that of E contracted with the bearings.
    const Matrix3d outer = a * b.transpose();
    EXPECT_LE((r.by_pose - columns(outer).transpose() * x.essentialMatrixJacobian()).norm(), 16 * eps);
  }
}

TEST_F(EssentialTest, TurningTheViewsTurnsTheMatrix) {
  const Essentiald x = pose();
  const SO3d f_a = SO3d::exp(vector()), f_b = SO3d::exp(vector());
  const Essentiald y = act(T::Group(f_a, f_b), x);
  EXPECT_LE((y.essentialMatrix() - f_a.matrix() * x.essentialMatrix() * f_b.matrix().transpose()).norm(), 16 * eps);
  const Vector3d a = vector(), b = vector();
  EXPECT_NEAR(y.epipolarResidual(f_a * a, f_b * b).value, x.epipolarResidual(a, b).value, 16 * eps);
}

TEST_F(EssentialTest, FourRelativePosesMakeOneConstraint) {
  for (int i = 0; i < 50; ++i) {
    const Essentiald x = pose();
    const Matrix3d E = x.essentialMatrix();
    const double scale = i % 2 == 0 ? 1 : 1e-3;
    const auto four = decomposeEssential(Matrix3d(scale * E));
    double nearest = 10;
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_LE((four[k].essentialMatrix() - (k < 2 ? 1 : -1) * E).norm(), 16 * eps) << k;
      nearest = std::min(nearest, distance(four[k], x));
      // The pose is among those of -E too.
      double of_minus = 10;
      for (const Essentiald& y : decomposeEssential(Matrix3d(-E))) of_minus = std::min(of_minus, distance(four[k], y));
      EXPECT_LE(of_minus, 16 * eps);
    }
    EXPECT_LE(nearest, 16 * eps);
    // Twisted: half a turn about the direction, the last coordinate of the tangent; and the direction the other way.
    const Essentiald twisted = exp(four[0], Tangent(static_cast<double>(EIGEN_PI) * Tangent::Unit(4)));
    EXPECT_LE(distance(SO3d(twisted.so3()), SO3d(four[1].so3())), 16 * eps);
    EXPECT_LE(distance(twisted, four[2]), 16 * eps);
    EXPECT_NEAR(distance(four[0], four[3]), EIGEN_PI, 16 * eps);
  }
}

// Axes on which entries vanish, and directions along the axes: every choice of the longest column.
TEST_F(EssentialTest, DecomposesWhereEntriesVanish) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      for (const SO3d& R : {SO3d(), SO3d::rotX(EIGEN_PI), SO3d::rotY(EIGEN_PI), SO3d::rotZ(EIGEN_PI), SO3d::rotX(1)}) {
        const Essentiald x(R, Vector3d(sign * Vector3d::Unit(axis)));
        double nearest = 10;
        for (const Essentiald& y : decomposeEssential(x.essentialMatrix())) nearest = std::min(nearest, distance(x, y));
        EXPECT_LE(nearest, 16 * eps);
      }
    }
  }
}

// Decomposing a nearly essential matrix gives a pose within a few times the perturbation, and rotations of unit norm.
TEST_F(EssentialTest, DecomposesWhatIsNearlyEssential) {
  for (int i = 0; i < 20; ++i) {
    const Essentiald x = pose();
    Matrix3d noise;
    noise << vector(), vector(), vector();
    for (const double size : {1e-12, 1e-6, 1e-3, 1e-2}) {
      double nearest = 10;
      for (const Essentiald& y : decomposeEssential(Matrix3d(x.essentialMatrix() + size * noise))) {
        nearest = std::min(nearest, distance(x, y));
        EXPECT_NEAR(y.so3().params().norm(), 1, 8 * eps);
      }
      EXPECT_LE(nearest, 4 * size);
    }
  }
  const Matrix3d zero = Matrix3d::Zero();
  EXPECT_TRUE(decomposeEssential(zero)[0].params().hasNaN());
}

TEST_F(EssentialTest, CheiralityFindsThePose) {
  for (int i = 0; i < 20; ++i) {
    const SE3d a_T_b(SO3d::exp(0.3 * vector()), vector());
    const Essentiald x(a_T_b);
    std::vector<Vector3d> a, b;
    while (a.size() < 10) {
      const Vector3d in_b = vector() + Vector3d(0, 0, 4), in_a = a_T_b * in_b;
      a.push_back(in_a.normalized()), b.push_back(in_b.normalized());
    }
    // Two outliers: points behind one of the views.
    a[3] = -a[3], b[7] = -b[7];
    const auto four = decomposeEssential(Matrix3d(-x.essentialMatrix()));
    const Cheirality choice = chooseByCheirality(four, a, b);
    EXPECT_LE(distance(four[choice.best], x), 32 * eps);
    ASSERT_EQ(choice.counts.size(), 4U);
    EXPECT_EQ(choice.counts[choice.best], 8U);
    for (std::size_t k = 0; k < 4; ++k) EXPECT_TRUE(k == choice.best || choice.counts[k] <= 2);
  }
  const std::vector<Vector3d> none;
  EXPECT_EQ(chooseByCheirality(std::vector<Essentiald>{pose()}, none, none).counts[0], 0U);
}

}  // namespace
