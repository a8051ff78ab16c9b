// Members, statics and constants that a program written for Sophus calls on every group, under the names that it knows,
// with the meaning that their comments state there.

#include <lie/lie.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <type_traits>
#include <vector>

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
  // Many points at once, as columns, as an expression and in a container, move as each of them does.
  std::vector<typename G::Point> points;
  Eigen::Matrix<double, G::Dim, Eigen::Dynamic> columns(G::Dim, 5);
  for (int j = 0; j < 5; ++j) points.push_back(columns.col(j) = p + j * d);
  const Eigen::Matrix<double, G::Dim, Eigen::Dynamic> moved_columns = x * columns, doubled = x * (2 * columns);
  const Eigen::Matrix<double, G::Dim, 3> some = x * columns.template middleCols<3>(1);
  const std::vector<typename G::Point> moved_points = x * points;
  ASSERT_EQ(moved_points.size(), 5);
  for (int j = 0; j < 5; ++j) {
    const typename G::Point q = columns.col(j);
    const double tolerance = 16 * eps * M.norm() * (1 + 2 * q.norm());
    EXPECT_LE((moved_columns.col(j) - x * q).norm(), tolerance);
    EXPECT_LE((doubled.col(j) - x * typename G::Point(2 * q)).norm(), tolerance);
    EXPECT_EQ(moved_points[static_cast<std::size_t>(j)], moved_columns.col(j));
  }
  EXPECT_EQ(some, (moved_columns.template middleCols<3>(1)));
  EXPECT_EQ((x * columns.leftCols(0)).cols(), 0);
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

}  // namespace
