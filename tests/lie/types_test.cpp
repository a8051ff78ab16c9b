// The concepts that each manifold satisfies, and that every class template and view compiles as a whole, with every
// member, for float, double and ceres::Jet.

#include <lie/lie.hpp>

#include <ceres/jet.h>
#include <gtest/gtest.h>

#include <complex>
#include <limits>

using Jet3 = ceres::Jet<double, 3>;

#define LIESTAT_INSTANTIATE(Type, S)           \
  template class liestat::Type<S>;             \
  template class Eigen::Map<liestat::Type<S>>; \
  template class Eigen::Map<const liestat::Type<S>>;
#define LIESTAT_INSTANTIATE_ALL(Type) \
  LIESTAT_INSTANTIATE(Type, float)    \
  LIESTAT_INSTANTIATE(Type, double)   \
  LIESTAT_INSTANTIATE(Type, Jet3)

LIESTAT_INSTANTIATE_ALL(SO2)
LIESTAT_INSTANTIATE_ALL(SO3)
LIESTAT_INSTANTIATE_ALL(SE2)
LIESTAT_INSTANTIATE_ALL(SE3)
LIESTAT_INSTANTIATE_ALL(RxSO2)
LIESTAT_INSTANTIATE_ALL(RxSO3)
LIESTAT_INSTANTIATE_ALL(Sim2)
LIESTAT_INSTANTIATE_ALL(Sim3)
LIESTAT_INSTANTIATE_ALL(SE23)
LIESTAT_INSTANTIATE_ALL(S2)
LIESTAT_INSTANTIATE_ALL(OrientedPoint)
LIESTAT_INSTANTIATE_ALL(Essential)
LIESTAT_INSTANTIATE_ALL(Frame2)
LIESTAT_INSTANTIATE_ALL(Frame3)
LIESTAT_INSTANTIATE_ALL(SemiOrientedFrame3)
LIESTAT_INSTANTIATE_ALL(NonOrientedFrame3)
template class liestat::Translation<float, 2>;
template class liestat::Translation<double, 3>;
template class liestat::Translation<Jet3, 3>;

namespace {

using namespace liestat;

static_assert(LieGroup<SO2d> && LieGroup<SO3d> && LieGroup<SE2d> && LieGroup<SE3d> && LieGroup<Translation<double, 3>>);
static_assert(LieGroup<SO3f> && LieGroup<SO3<Jet3>> && LieGroup<SE3<Jet3>>);
static_assert(Metric<Translation<double, 3>>);
static_assert(LieGroup<SE23d> && LieGroup<SE23<Jet3>> && Homogeneous<SE23f> && !Metric<SE23d>);
static_assert(!LieGroup<S2d> && !LieGroup<Frame3d> && !LieGroup<Eigen::Vector3d>);

static_assert(Homogeneous<SE2d> && Homogeneous<SE3d> && Homogeneous<SE3<Jet3>>);
static_assert(LieGroup<RxSO2d> && LieGroup<RxSO3d> && LieGroup<Sim2d> && LieGroup<Sim3f> && LieGroup<Sim3<Jet3>>);
static_assert(Metric<RxSO2d> && Metric<RxSO3d> && Homogeneous<Sim2d> && Homogeneous<Sim3d>);
static_assert(!Metric<Sim2d> && !Metric<Sim3d>);
static_assert(!Metric<SE2d> && !Metric<SE3d>, "no invariant metric has the screw motions as geodesics");
static_assert(Metric<Eigen::Vector3d> && Metric<Eigen::Matrix<float, 7, 1>> && Metric<SO2d> && Metric<SO3d>);
static_assert(Metric<S2d> && Metric<Frame2d> && Metric<Frame3d> && Metric<Frame3<Jet3>>);
static_assert(Metric<SemiOrientedFrame3d> && Metric<NonOrientedFrame3f>);
static_assert(Quotient<SemiOrientedFrame3d> && Quotient<NonOrientedFrame3d> && !Quotient<Frame3d> && !Quotient<SO3d>);

static_assert(Metric<OrientedPointd> && Metric<OrientedPoint<Jet3>> && Metric<Essentiald> && Metric<Essential<Jet3>>);
static_assert(sizeof(OrientedPointd) == 6 * sizeof(double) && sizeof(Essentialf) == 7 * sizeof(float));

// A product is what all of its parts are; a quotient if one of them is.
static_assert(Metric<Product<SO3d, Eigen::Vector3d>> && Metric<Product<Frame3d, Product<S2d, SO2d>>>);
static_assert(Metric<Product<SO3<Jet3>, S2<Jet3>>> && !Quotient<Product<SO3d, S2d>>);
static_assert(Homogeneous<Product<SE3d, S2d>> && !Metric<Product<SE3d, S2d>>);
static_assert(Quotient<Product<SO3d, NonOrientedFrame3d>> && Metric<Product<SO3d, NonOrientedFrame3d>>);
static_assert(!LieGroup<Product<SO3d, SE3d>> && LieGroup<ProductGroup<SO3d, SE3d>>);
static_assert(LieGroup<ProductGroup<SO3f, Translation<float, 2>>> && Metric<ProductGroup<SO3f, Translation<float, 2>>>);
static_assert(Homogeneous<ProductGroup<SO3d, SE3d>> && !Metric<ProductGroup<SO3d, SE3d>>);

// Sizes unknown at compile time, row vectors and integers are not manifolds.
static_assert(!Homogeneous<Eigen::VectorXd> && !Homogeneous<Eigen::MatrixXd> && !Homogeneous<Eigen::Vector3i>);
static_assert(!Homogeneous<Eigen::RowVector3d> && !Homogeneous<Eigen::Matrix3d> && !Homogeneous<int>);

// Parameters are all there is in memory: arrays of them are arrays of scalars, as Sophus and Ceres have them.
static_assert(sizeof(SO2d) == 2 * sizeof(double) && sizeof(SO3d) == 4 * sizeof(double));
static_assert(sizeof(SE2f) == 4 * sizeof(float) && sizeof(SE3d) == 7 * sizeof(double));
static_assert(sizeof(SE23d) == 10 * sizeof(double));
static_assert(sizeof(S2d) == 3 * sizeof(double) && sizeof(Frame3f) == 7 * sizeof(float));

TEST(Types, ThePosesShareTheirMemoryLayout) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(0.1, 0.2, 0.3, 0.4).normalized();
  const Eigen::Vector3d t(5, 6, 7);
  const SE3d pose(q, t);
  for (int i = 0; i < 4; ++i) EXPECT_EQ(pose.data()[i], SO3d(q).data()[i]);
  // Eigen's order, x y z w, normalised once more to the last bit at most.
  EXPECT_LE((SO3d(q).params() - q.coeffs()).norm(), 2 * std::numeric_limits<double>::epsilon());
  for (int i = 0; i < 3; ++i) EXPECT_EQ(pose.data()[4 + i], t[i]);
  EXPECT_EQ(Frame3d(pose).params(), pose.params());
  EXPECT_EQ(Frame3d(pose).se3().params(), pose.params());
  EXPECT_EQ(NonOrientedFrame3d(pose).params(), pose.params());
}

TEST(Types, ViewsOfPartsWriteThrough) {
  SE3d pose;
  pose.translation() << 1, 2, 3;
  pose.so3() = SO3d::rotX(0.5);
  EXPECT_EQ(pose.data()[4], 1);
  EXPECT_DOUBLE_EQ(pose.data()[0], std::sin(0.25));
  double memory[7] = {0, 0, 0, 1, 0, 0, 0};
  Eigen::Map<SE3d> view(memory);
  view.translation() << 4, 5, 6;
  view.so3() = SO3d::rotZ(1);
  EXPECT_EQ(memory[6], 6);
  EXPECT_EQ(memory[2], SO3d::rotZ(1).data()[2]);
  view *= SE3d::transX(1);
  EXPECT_DOUBLE_EQ(memory[4], 4 + std::cos(1.0)) << "the translation is in the body frame";
}

TEST(Types, CheckedConstructorsRefuse) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(SO3d::checkedFromMatrix(Eigen::Matrix3d::Identity()));
  EXPECT_FALSE(SO3d::checkedFromMatrix(-Eigen::Matrix3d::Identity())) << "a reflection";
  EXPECT_FALSE(SO3d::checkedFromMatrix(1.01 * Eigen::Matrix3d::Identity()));
  EXPECT_FALSE(SO3d::checkedFromMatrix(nan * Eigen::Matrix3d::Identity()));
  EXPECT_TRUE(SO3d::checkedFromQuaternion(Eigen::Quaterniond(1.0005, 0, 0, 0)));
  EXPECT_FALSE(SO3d::checkedFromQuaternion(Eigen::Quaterniond(1.1, 0, 0, 0)));
  EXPECT_FALSE(SO3d::checkedFromQuaternion(Eigen::Quaterniond(nan, 0, 0, 0)));
  EXPECT_FALSE(SO3d::checkedFromQuaternion(Eigen::Quaterniond(0, 0, 0, 0)));
}

TEST(Types, NaNGivesNaN) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(SO3d::exp(Eigen::Vector3d(nan, 0, 0)).log().hasNaN());
  EXPECT_TRUE(SE3d::exp(Eigen::Matrix<double, 6, 1>::Constant(nan)).log().array().isNaN().all());
  EXPECT_TRUE(SO2d(nan).log().hasNaN());
  EXPECT_TRUE(SO3d(Eigen::Matrix3d::Constant(nan)).params().hasNaN());
  EXPECT_TRUE(SO3d(Eigen::Quaterniond(0, 0, 0, 0)).params().hasNaN());
  EXPECT_TRUE(S2d(0, 0, 0).params().hasNaN());
  EXPECT_TRUE(log(S2d(), S2d(nan, 0, 1)).hasNaN());
  EXPECT_TRUE(std::isnan(distance(
      NonOrientedFrame3d(), NonOrientedFrame3d(SO3d::exp(Eigen::Vector3d::Constant(nan)), Eigen::Vector3d::Zero()))));
}

}  // namespace
