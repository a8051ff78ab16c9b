// What a program that was written for Sophus calls, on every group: members, statics and constants under the names that
// it knows, with the meaning that their comments state there.

#include <lie/lie.hpp>

#include <Eigen/SVD>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <type_traits>

namespace {

using namespace liestat;

constexpr double eps = std::numeric_limits<double>::epsilon();

template <class G>
class SophusApi : public testing::Test {
 public:
  using Tangent = typename G::Tangent;
  static Tangent tangent(double scale = 1) {
    Tangent v;
    for (int i = 0; i < G::DoF; ++i) v[i] = scale * (0.4 - 0.3 * i + 0.11 * i * i);
    return v;
  }
  static typename G::Point point() {
    typename G::Point p;
    for (int i = 0; i < G::Dim; ++i) p[i] = 1.5 - i;
    return p;
  }
};
using Groups = testing::Types<SO2d, SO3d, SE2d, SE3d, RxSO2d, RxSO3d, Sim2d, Sim3d>;
TYPED_TEST_SUITE(SophusApi, Groups);

TYPED_TEST(SophusApi, ConstantsAndTypes) {
  using G = TypeParam;
  static_assert(std::is_same_v<typename G::Tangent, Eigen::Matrix<double, G::DoF, 1>>);
  static_assert(std::is_same_v<typename G::Adjoint, Eigen::Matrix<double, G::DoF, G::DoF>>);
  static_assert(std::is_same_v<typename G::Transformation, Eigen::Matrix<double, G::N, G::N>>);
  static_assert(std::is_same_v<typename G::Point, Eigen::Matrix<double, G::Dim, 1>>);
  static_assert(std::is_same_v<typename G::HomogeneousPoint, Eigen::Matrix<double, G::Dim + 1, 1>>);
  static_assert(sizeof(G) == G::num_parameters * sizeof(double));
  // Results are plain types of Eigen, which live on their own.
  static_assert(std::is_same_v<decltype(G().log()), typename G::Tangent>);
  static_assert(std::is_same_v<decltype(G().matrix()), typename G::Transformation>);
  static_assert(std::is_same_v<decltype(G() * typename G::Point()), typename G::Point>);
  static_assert(std::is_same_v<decltype(G() * Eigen::Map<const G>(nullptr)), G>);
  EXPECT_EQ(G().matrix(), G::Transformation::Identity());
}

TYPED_TEST(SophusApi, PointsLinesAndHyperplanes) {
  using G = TypeParam;
  const G x = G::exp(this->tangent());
  const typename G::Point p = this->point(), d = (p + G::Point::Ones()).normalized();
  const auto M = x.matrix();

  for (const double w : {1., 0., 2.5}) {
    typename G::HomogeneousPoint h;
    h << p, w;
    const typename G::HomogeneousPoint moved = x * h;
    EXPECT_EQ(moved[G::Dim], w);
    if constexpr (G::N > G::Dim) {
      EXPECT_LE((moved - M * h).norm(), 8 * eps * M.norm() * h.norm()) << w;
    } else {
      EXPECT_LE((moved.template head<G::Dim>() - M * p).norm(), 8 * eps * M.norm() * h.norm()) << w;
    }
  }
  // Points of a line are points of the moved line, and its direction keeps its norm.
  const typename G::Line line(p, d), moved_line = x * line;
  EXPECT_LE((moved_line.origin() - x * p).norm(), 8 * eps);
  EXPECT_NEAR(moved_line.direction().norm(), 1, 8 * eps);
  EXPECT_LE(moved_line.distance(x * line.pointAt(3)), 64 * eps * M.norm());
  // Points of a plane are points of the moved plane; others are as far from it, times the scale.
  const typename G::Hyperplane plane(d, p), moved_plane = x * plane;
  EXPECT_NEAR(moved_plane.normal().norm(), 1, 8 * eps);
  EXPECT_LE(moved_plane.absDistance(x * p), 16 * eps * M.norm());
  const double scale = std::pow(std::abs(M.template topLeftCorner<G::Dim, G::Dim>().determinant()), 1. / G::Dim);
  EXPECT_NEAR(moved_plane.signedDistance(x * (p + 2 * d)), 2 * scale, 32 * eps * M.norm());
}

TYPED_TEST(SophusApi, GeneratorsAndBrackets) {
  using G = TypeParam;
  using V = typename G::Tangent;
  const V v = this->tangent(), u = this->tangent(-0.7) + 0.2 * V::Ones();
  typename G::Transformation sum = G::Transformation::Zero();
  for (int i = 0; i < G::DoF; ++i) {
    EXPECT_EQ(G::generator(i), G::hat(V::Unit(i)));
    EXPECT_EQ(G::Dxi_exp_x_matrix_at_0(i), G::generator(i));
    sum += v[i] * G::generator(i);
  }
  EXPECT_LE((G::hat(v) - sum).norm(), 4 * eps);
  EXPECT_EQ(G::vee(G::hat(v)), v);
  const typename G::Transformation bracket = G::hat(v) * G::hat(u) - G::hat(u) * G::hat(v);
  EXPECT_LE((G::hat(G::lieBracket(v, u)) - bracket).norm(), 16 * eps);
  // hat(Adj v) = x hat(v) x⁻¹
  const G x = G::exp(u);
  EXPECT_LE((G::hat(x.Adj() * v) - x.matrix() * G::hat(v) * x.inverse().matrix()).norm(), 64 * eps);
}

TYPED_TEST(SophusApi, DerivativesOnParameters) {
  using G = TypeParam;
  const typename G::Tangent v = this->tangent();
  const G x = G::exp(v);
  EXPECT_LE((x.Dx_log_this_inv_by_x_at_this() * x.Dx_this_mul_exp_x_at_0() - G::Adjoint::Identity()).norm(), 16 * eps);
  EXPECT_EQ(G::Dx_exp_x_at_0(), G().Dx_this_mul_exp_x_at_0());
  EXPECT_LE((G::Dx_exp_x(G::Tangent::Zero()) - G::Dx_exp_x_at_0()).norm(), 4 * eps);
  // Central differences of second order: h² and eps/h are of one size at eps^(1/3).
  const double h = 6e-6, tolerance = 1e-9;
  const typename G::Point p = this->point();
  for (int i = 0; i < G::DoF; ++i) {
    const typename G::Tangent e = h * G::Tangent::Unit(i);
    EXPECT_LE(((G::exp(v + e).params() - G::exp(v - e).params()) / (2 * h) - G::Dx_exp_x(v).col(i)).norm(), tolerance);
    EXPECT_LE(
        (((x * G::exp(e)).params() - (x * G::exp(-e)).params()) / (2 * h) - x.Dx_this_mul_exp_x_at_0().col(i)).norm(),
        tolerance);
    EXPECT_LE(((G::exp(e) * p - G::exp(-e) * p) / (2 * h) - G::Dx_exp_x_times_point_at_0(p).col(i)).norm(), tolerance);
    EXPECT_LE(((G::exp(e).matrix() - G::exp(-e).matrix()) / (2 * h) - G::Dxi_exp_x_matrix_at_0(i)).norm(), tolerance);
  }
}

TYPED_TEST(SophusApi, UniformSamples) {
  using G = TypeParam;
  // The same numbers from the same seed; 32 and 64 bits at a time.
  std::mt19937 narrow(3), again(3);
  std::mt19937_64 wide(3);
  std::minstd_rand odd(3);  // 2^31 - 1 values, from one
  EXPECT_EQ(G::sampleUniform(narrow).params(), G::sampleUniform(again).params());
  const int n = 4000;
  typename G::Point mean = G::Point::Zero();
  double largest = 0;
  for (int i = 0; i < n; ++i) {
    const G x = i % 3 == 0 ? G::sampleUniform(narrow) : i % 3 == 1 ? G::sampleUniform(wide) : G::sampleUniform(odd);
    EXPECT_LE((x * x.inverse() * this->point() - this->point()).norm(), 64 * eps);
    using Point = typename G::Point;
    const Point turned = x * Point(Point::Unit(0)) - x * Point(Point::Zero());
    mean += turned / n;
    largest = std::max(largest, turned.norm());
  }
  // Uniform directions: each coordinate has a variance of 1/Dim, times E s² = 3/(4 ln 2)·… ≤ 1.36 with a scale in
  // [1/2, 2]. Six standard errors are exceeded with a probability below 1e-8.
  EXPECT_LE(mean.norm(), 6 * std::sqrt(1.36 / n));
  EXPECT_LE(largest, 2.0000001);
  EXPECT_GE(largest, 0.999);
}

TYPED_TEST(SophusApi, CastsAndViews) {
  using G = TypeParam;
  const G x = G::exp(this->tangent());
  const auto f = x.template cast<float>();
  static_assert(std::is_same_v<typename decltype(f)::Scalar, float>);
  EXPECT_LE((f.template cast<double>().params() - x.params()).norm(), 1e-6);
  double memory[G::num_parameters];
  Eigen::Map<G> view(memory);
  view = x;
  view *= x.inverse();
  EXPECT_LE((view.params() - G().params()).norm(), 16 * eps);
  G copy = view;
  copy = x;
  EXPECT_EQ(copy.params(), x.params());
}

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

// The nearest rotation is that of the singular value decomposition, for matrices of either determinant, near and far
// from rotations.
TEST(FitToSO3, IsTheNearestRotation) {
  std::mt19937 generator(5);
  for (int trial = 0; trial < 3000; ++trial) {
    Eigen::Matrix3d M;
    for (int i = 0; i < 9; ++i) M(i) = detail::uniform<double>(generator, -1, 1);
    // From any matrix to nearly a rotation.
    if (trial % 3 == 1) M = SO3d::sampleUniform(generator).matrix() + 1e-3 * M;
    if (trial % 3 == 2) M = SO3d::sampleUniform(generator).matrix() + 1e-12 * M;
    if (trial % 7 == 0) M *= 1e8;
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Eigen::Matrix3d U = svd.matrixU(), V = svd.matrixV();
    const double sign = (U * V.transpose()).determinant();
    const Eigen::Matrix3d nearest = U * Eigen::Vector3d(1, 1, sign).asDiagonal() * V.transpose();
    // A perturbation of M turns the result by its size over the least of the sums of two singular values.
    const Eigen::Vector3d s = svd.singularValues();
    const double gap = (s[1] + sign * s[2]) / s[0];
    EXPECT_LE((SO3d::fitToSO3(M).matrix() - nearest).norm(), 64 * eps / gap) << M << "\n gap " << gap;
  }
}
TEST(FitToSO3, OfMatricesWithoutOneNearestRotationIsARotation) {
  for (const Eigen::Matrix3d& M :
       {Eigen::Matrix3d(Eigen::Matrix3d::Zero()), Eigen::Matrix3d(-Eigen::Matrix3d::Identity()),
        Eigen::Matrix3d(Eigen::Vector3d(1, 0, 0).asDiagonal()), Eigen::Matrix3d(Eigen::Matrix3d::Ones())}) {
    const Eigen::Matrix3d R = SO3d::fitToSO3(M).matrix();
    EXPECT_LE((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 8 * eps) << M;
    // No rotation is nearer: tr(Rᵀ M) is the sum of the singular values, the least with the sign of the determinant.
    const Eigen::Vector3d s = Eigen::JacobiSVD<Eigen::Matrix3d>(M).singularValues();
    EXPECT_NEAR((R.transpose() * M).trace(), s[0] + s[1] + (M.determinant() < 0 ? -s[2] : s[2]), 1e-7) << M;
  }
  EXPECT_TRUE(SO3d::fitToSO3(Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN())).params().hasNaN());
}

}  // namespace
