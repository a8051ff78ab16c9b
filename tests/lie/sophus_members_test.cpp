// Constructors, accessors and setters that a program written for Sophus calls on one group or a few, under the names
// that it knows. Members of every group are in sophus_api_test.cpp.

#include <lie/lie.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <type_traits>

namespace {

using namespace liestat;

constexpr double eps = std::numeric_limits<double>::epsilon();

TEST(SophusSO2, Members) {
  SO2d x(0.3);
  EXPECT_NEAR(x.angle(), 0.3, eps);
  EXPECT_EQ(SO2d::exp(0.3).params(), x.params());
  EXPECT_EQ(SO2d(Eigen::Vector2d(2, 0)).params(), SO2d().params());
  EXPECT_LE((SO2d(x.matrix()).params() - x.params()).norm(), 2 * eps);
  EXPECT_LE((SO2d(Eigen::Matrix2d(x.matrix() * x.matrix())).params() - SO2d(0.6).params()).norm(), 4 * eps);
  x.setComplex(Eigen::Vector2d(0, 3));
  EXPECT_NEAR(x.angle(), EIGEN_PI / 2, eps);
  EXPECT_EQ(x.unit_complex(), Eigen::Vector2d(0, 1));
  EXPECT_EQ(SO2d::hat(2.), SO2d::hat(SO2d::Tangent(2)));
  EXPECT_NEAR(SO2d::fitToSO2(3 * SO2d(1.2).matrix()).angle(), 1.2, 2 * eps);
}

TEST(Sophus, ConstructorsFromComplexNumbersQuaternionsAndMatrices) {
  const Eigen::Vector2d z(3, 4), p(1, -2);
  const SE2d planar(z, p);
  EXPECT_LT((planar.unit_complex() - z / 5).norm(), eps);
  EXPECT_EQ(planar.translation(), p);
  EXPECT_EQ(SE2d(Eigen::Vector2d::UnitY(), p).so2().angle(), SO2d(Eigen::Vector2d(0, 1)).angle());
  EXPECT_EQ(SE2d(planar.rotationMatrix(), p).params(), planar.params());
  static_assert(!std::is_constructible_v<SE2d, Eigen::Vector3d, Eigen::Vector2d>);
  static_assert(!std::is_constructible_v<SE2d, Eigen::Matrix3d, Eigen::Vector2d>);

  const Eigen::Quaterniond q(0.1, -0.7, 0.2, 0.4);
  const Eigen::Vector3d t(1, 2, 3);
  const RxSO3d scaled(2.5, q);
  EXPECT_NEAR(scaled.scale(), 2.5, 4 * eps);
  EXPECT_LT((scaled.so3().inverse() * SO3d(q)).log().norm(), 4 * eps);
  const Sim3d similarity(2.5, q, t);
  EXPECT_EQ(similarity.rxso3().params(), scaled.params());
  EXPECT_EQ(similarity.translation(), t);

  const SO3d from_matrix = SO3d(q).matrix();
  EXPECT_LT((from_matrix.inverse() * SO3d(q)).log().norm(), 4 * eps);
  static_assert(std::is_convertible_v<Eigen::Matrix3d, SO3d>);
}

TEST(Sophus, NestedTypesOfResults) {
  static_assert(std::is_same_v<SO3d::SO3Product<SO3d>, SO3d>);
  static_assert(std::is_same_v<SE3f::SE3Product<SE3f>, SE3f>);
  static_assert(std::is_same_v<SO2d::SO2Product<Eigen::Map<const SO2d>>, SO2d>);
  static_assert(std::is_same_v<SE2d::SE2Product<SE2d>, SE2d>);
  static_assert(std::is_same_v<RxSO2d::RxSO2Product<RxSO2d>, RxSO2d>);
  static_assert(std::is_same_v<RxSO3d::RxSO3Product<RxSO3d>, RxSO3d>);
  static_assert(std::is_same_v<Sim2d::Sim2Product<Sim2d>, Sim2d>);
  static_assert(std::is_same_v<Eigen::Map<Sim3d>::Sim3Product<Sim3d>, Sim3d>);
  static_assert(std::is_same_v<SE3d::ReturnScalar<Eigen::Vector3d>, double>);
  static_assert(std::is_same_v<SE3d::PointProduct<Eigen::Vector3d>, Eigen::Vector3d>);
  static_assert(std::is_same_v<SE3d::HomogeneousPointProduct<Eigen::Vector4d>, Eigen::Vector4d>);
}

TEST(SophusSO3, Members) {
  for (const double a : {0., 1e-9, 0.7, 3.1, double(EIGEN_PI)}) {
    EXPECT_EQ(SO3d::rotX(a).params(), SO3d::exp(Eigen::Vector3d(a, 0, 0)).params());
    EXPECT_EQ(SO3d::rotY(a).params(), SO3d::exp(Eigen::Vector3d(0, a, 0)).params());
    EXPECT_EQ(SO3d::rotZ(a).params(), SO3d::exp(Eigen::Vector3d(0, 0, a)).params());
    // At the half-turn rounding decides the sign.
    EXPECT_NEAR(std::abs(SO3d::rotX(a).angleX()), a, 2 * eps);
    EXPECT_NEAR(std::abs(SO3d::rotY(a).angleY()), a, 2 * eps);
    EXPECT_NEAR(std::abs(SO3d::rotZ(a).angleZ()), a, 2 * eps);
    EXPECT_NEAR(SO3d::rotX(0.5 * a).angleX(), 0.5 * a, 2 * eps);
  }
  const Eigen::Vector3d v(0.3, -1, 0.4);
  double theta = 0;
  const SO3d x = SO3d::expAndTheta(v, &theta);
  EXPECT_DOUBLE_EQ(theta, v.norm());
  EXPECT_DOUBLE_EQ(x.logAndTheta().theta, v.norm());
  EXPECT_EQ(x.logAndTheta().tangent, x.log());
  EXPECT_EQ(SO3d().logAndTheta().theta, 0);
  SO3d y;
  y.setQuaternion(Eigen::Quaterniond(2 * x.unit_quaternion().coeffs()));
  EXPECT_LE((y.params() - x.params()).norm(), 2 * eps);
}

TEST(SophusSE3, Members) {
  SE3d x(SO3d::rotX(0.3), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(x.matrix3x4(), x.matrix().topRows<3>());
  EXPECT_EQ(x.rotationMatrix(), x.so3().matrix());
  x.setQuaternion(Eigen::Quaterniond(0, 0, 0, 5));
  EXPECT_EQ(x.unit_quaternion().coeffs(), Eigen::Vector4d(0, 0, 1, 0));
  x.setRotationMatrix(SO3d::rotY(0.5).matrix());
  EXPECT_NEAR(x.angleY(), 0.5, 2 * eps);
  EXPECT_EQ(x.translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(SE3d::trans(1, 2, 3).params(), (SE3d::transX(1) * SE3d::transY(2) * SE3d::transZ(3)).params());
  EXPECT_EQ(SE3d::rotZ(0.2).so3().params(), SO3d::rotZ(0.2).params());
  EXPECT_LE((SE3d(x.matrix()).params() - x.params()).norm(), 2 * eps);
  EXPECT_LE((SE3d::fitToSE3(x.matrix()).params() - x.params()).norm(), 8 * eps);
  const SE3d from_expression(Eigen::Matrix3d(x.rotationMatrix() * x.rotationMatrix()), 2 * x.translation());
  EXPECT_LE((from_expression.translation() - Eigen::Vector3d(2, 4, 6)).norm(), eps);
}

TEST(SophusSE2, Members) {
  SE2d x(0.3, Eigen::Vector2d(1, 2));
  EXPECT_EQ(x.matrix2x3(), x.matrix().topRows<2>());
  x.so2() = SO2d(0.4);
  EXPECT_EQ(x.unit_complex(), SO2d(0.4).params());
  x.setComplex(Eigen::Vector2d(0, 2));
  EXPECT_EQ(x.unit_complex(), Eigen::Vector2d(0, 1));
  x.setRotationMatrix(SO2d(0.1).matrix());
  EXPECT_LE((x.rotationMatrix() - SO2d(0.1).matrix()).norm(), 4 * eps);
  EXPECT_EQ(SE2d::trans(1, 2).translation(), (SE2d::transX(1) * SE2d::transY(2)).translation());
  EXPECT_EQ(SE2d::rot(0.2).so2().params(), SO2d(0.2).params());
  EXPECT_LE((SE2d::fitToSE2(x.matrix()).params() - x.params()).norm(), 4 * eps);
}

// Scale and rotation are set one by one and together; neither disturbs the other.
template <class Plane, class G>
void checkScaleMembers(G x, const typename G::Transformation& R) {
  x.setScale(3);
  const auto before = x.rotationMatrix();
  EXPECT_NEAR(x.scale(), 3, 8 * eps);
  x.setScale(0.25);
  EXPECT_NEAR(x.scale(), 0.25, eps);
  EXPECT_LE((x.rotationMatrix() - before).norm(), 8 * eps);
  EXPECT_LE((x.matrix() - 0.25 * before).norm(), 4 * eps);
  x.setRotationMatrix(R);
  EXPECT_NEAR(x.scale(), 0.25, eps);
  EXPECT_LE((x.rotationMatrix() - R).norm(), 8 * eps);
  x.setScaledRotationMatrix(7 * before);
  EXPECT_NEAR(x.scale(), 7, 16 * eps);
  EXPECT_LE((x.matrix() - 7 * before).norm(), 64 * eps);
  EXPECT_LE((G(7 * before).matrix() - x.matrix()).norm(), 64 * eps);
  EXPECT_LE((G(2., R).matrix() - 2 * R).norm(), 16 * eps);
  EXPECT_LE((G(2., Plane(R)).matrix() - 2 * R).norm(), 16 * eps);
}
TEST(SophusRxSO, Members) {
  checkScaleMembers<SO2d>(RxSO2d(2., SO2d(0.4)), SO2d(-2).matrix());
  checkScaleMembers<SO3d>(RxSO3d(2., SO3d::rotX(0.4)), SO3d::exp(Eigen::Vector3d(1, 2, 1)).matrix());
  RxSO2d z(0, 2);
  EXPECT_EQ(z.complex(), Eigen::Vector2d(0, 2));
  z.setAngle(0.5);
  EXPECT_NEAR(z.angle(), 0.5, eps);
  EXPECT_NEAR(z.so2().angle(), 0.5, eps);
  EXPECT_NEAR(z.scale(), 2, 2 * eps);
  const RxSO3d q(Eigen::Quaterniond(0, 0, 3, 0));
  EXPECT_EQ(q.scale(), 9);
  EXPECT_EQ(q.so3().params(), Eigen::Vector4d(0, 1, 0, 0));
  double theta = 0;
  RxSO3d::expAndTheta(Eigen::Vector4d(0, 3, 4, 7), &theta);
  EXPECT_EQ(theta, 5);
}
TEST(SophusSim, Members) {
  Sim3d x(RxSO3d(2., SO3d::rotX(0.3)), Eigen::Vector3d(1, 2, 3));
  EXPECT_LE((Sim3d(x.matrix()).params() - x.params()).norm(), 8 * eps);
  EXPECT_EQ(x.matrix3x4(), x.matrix().topRows<3>());
  x.setScale(5);
  x.setRotationMatrix(SO3d::rotY(1).matrix());
  EXPECT_NEAR(x.scale(), 5, 8 * eps);
  EXPECT_LE((x.rotationMatrix() - SO3d::rotY(1).matrix()).norm(), 8 * eps);
  EXPECT_LE((x.so3().params() - SO3d::rotY(1).params()).norm(), 4 * eps);
  x.rxso3() = RxSO3d(3., SO3d());
  x.translation() *= 2;
  EXPECT_LE((x * Eigen::Vector3d(1, 1, 1) - Eigen::Vector3d(5, 7, 9)).norm(), 16 * eps);
  Sim2d y(Eigen::Vector2d(0, 2), Eigen::Vector2d(1, 1));
  EXPECT_LE((Sim2d(y.matrix()).params() - y.params()).norm(), 4 * eps);
  EXPECT_EQ(y * Eigen::Vector2d(1, 0), Eigen::Vector2d(1, 3));
  y.setScale(1);
  y.rxso2().setAngle(0);
  EXPECT_EQ(y.matrix2x3().col(2), Eigen::Vector2d(1, 1));
  EXPECT_EQ(y.so2().params(), SO2d().params());
}

}  // namespace
