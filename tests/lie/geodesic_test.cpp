// Closed forms: the point between two others (docs/theory/means.md, section 5.3), parallel transport on the sphere, the
// angular accessors, and the counterexamples at the cut locus.

#include <lie/lie.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace {

using namespace liestat;

// Some tens of rounding errors of numbers of the size of one.
const double some_eps = 32 * std::numeric_limits<double>::epsilon();

template <class M>
M point(double scale) {
  using T = ManifoldTraits<M>;
  typename T::Tangent v;
  for (int i = 0; i < T::DoF; ++i) v[i] = scale * (0.6 - 0.25 * i + 0.04 * i * i);
  return T::expOrigin(v);
}

/// The point at the fraction s of the way from x to y is their mean with the weights 1 - s and s: its distances are in
/// that ratio, and the weighted errors cancel.
template <class M>
class Between : public testing::Test {};
using Manifolds =
    testing::Types<Eigen::Vector3d, SO2d, SO3d, S2d, Frame2d, Frame3d, SemiOrientedFrame3d, NonOrientedFrame3d>;
TYPED_TEST_SUITE(Between, Manifolds);

TYPED_TEST(Between, InterpolationIsTheWeightedMean) {
  const TypeParam x = point<TypeParam>(1), y = point<TypeParam>(-0.7);
  for (const double s : {0.0, 0.25, 0.5, 0.9, 1.0}) {
    const TypeParam m = interpolate(x, y, s);
    EXPECT_NEAR(distance(x, m), s * distance(x, y), some_eps) << "s = " << s;
    EXPECT_NEAR(distance(m, y), (1 - s) * distance(x, y), some_eps) << "s = " << s;
    EXPECT_LE(((1 - s) * log(m, x) + s * log(m, y)).norm(), some_eps) << "s = " << s;
  }
}

TEST(Geodesic, MidpointOfTwoRotationsIsTheNormalisedSumOfTheirQuaternions) {
  const SO3d x = point<SO3d>(1), y = point<SO3d>(-0.7);
  const Eigen::Quaterniond sum(Eigen::Vector4d(x.params() + y.params()));
  EXPECT_LE(distance(interpolate(x, y, 0.5), SO3d(sum)), some_eps);
}

TEST(Geodesic, MidpointOfTwoDirectionsIsTheNormalisedSum) {
  const S2d x(0.3, -0.5, 0.2), y(0.1, 0.9, -0.4);
  EXPECT_LE(distance(interpolate(x, y, 0.5), S2d(x.params() + y.params())), some_eps);
}

TEST(Geodesic, FramesMeetInTheMiddleOfTheirTranslations) {
  const Frame3d x = point<Frame3d>(1), y = point<Frame3d>(-0.7), m = interpolate(x, y, 0.5);
  EXPECT_LE((m.translation() - (x.translation() + y.translation()) / 2).norm(), some_eps);
  EXPECT_LE(distance(SO3d(m.so3()), interpolate(SO3d(x.so3()), SO3d(y.so3()), 0.5)), some_eps);
}

TEST(Geodesic, TheScrewMotionIsNotTheFramesGeodesic) {
  // A quarter turn about z while moving by 1: the screw ends on a circle's chord, the frame goes straight.
  Eigen::Matrix<double, 6, 1> v;
  v << 1, 0, 0, 0, 0, EIGEN_PI / 2;
  EXPECT_LE((SE3d::exp(v).translation() - Eigen::Vector3d(2 / EIGEN_PI, 2 / EIGEN_PI, 0)).norm(), some_eps);
  EXPECT_LE((exp(Frame3d(), v).translation() - Eigen::Vector3d(1, 0, 0)).norm(), some_eps);
}

// Along a geodesic the tangent is carried to the tangent, on any of its arcs.
TEST(Geodesic, ParallelTransportOnTheSphereCarriesTheTangent) {
  const S2d points[] = {S2d(0.3, -0.5, 0.2), S2d(0.1, 0.9, -0.4), S2d(0, 0, 1), S2d(-1, 2, -9), S2d(1, 0, 0)};
  for (const S2d& x : points) {
    for (const S2d& y : points) {
      EXPECT_LE((frameTransport(x, y) * log(x, y) + log(y, x)).norm(), some_eps) << x << " to " << y;
      EXPECT_NEAR(frameTransport(x, y).determinant(), 1, some_eps);
    }
  }
}

// Round a triangle with three right angles a tangent vector turns by its area, a right angle (Gauss and Bonnet).
TEST(Geodesic, TransportRoundATriangleTurnsByItsArea) {
  const S2d x(1, 0, 0), y(0, 1, 0), z(0, 0, 1);
  const Eigen::Matrix2d turn = frameTransport(z, x) * frameTransport(y, z) * frameTransport(x, y);
  EXPECT_NEAR(turn.trace(), 0, some_eps);
  EXPECT_NEAR(std::abs(turn(1, 0)), 1, some_eps);
}

TEST(Geodesic, AnglesAreInTheirInterval) {
  EXPECT_NEAR(SO2d(3.0 + 2 * EIGEN_PI).angle(), 3, some_eps);
  EXPECT_NEAR(SO2d(-3.5).angle(), 2 * EIGEN_PI - 3.5, some_eps);
  EXPECT_NEAR(SO3d::rotX(1.2).angleX(), 1.2, some_eps);
  EXPECT_NEAR(SO3d::rotY(-2.9).angleY(), -2.9, some_eps);
  EXPECT_NEAR(SO3d::rotZ(3.1).angleZ(), 3.1, some_eps);
  EXPECT_NEAR(SO3d::rotX(1.2).angleZ(), 0, some_eps);
  // Beyond a half-turn the logarithm goes the other way round.
  EXPECT_LE((SO3d::rotX(4).log() - Eigen::Vector3d(4 - 2 * EIGEN_PI, 0, 0)).norm(), some_eps);
}

// The nearest representative at a tie, |w| = |z|, is the first: the one as stored.
TEST(Geodesic, TiesBetweenRepresentativesGoToTheFirst) {
  const double h = std::sqrt(0.5);
  const SemiOrientedFrame3d quarter(Eigen::Quaterniond(h, 0, 0, h), Eigen::Vector3d::Zero());
  const auto choice = ManifoldTraits<SemiOrientedFrame3d>::nearestRepresentative(quarter);
  EXPECT_EQ(choice.index, 0);
  EXPECT_EQ(choice.gap(), 0);
  EXPECT_NEAR(distance(SemiOrientedFrame3d(), quarter), EIGEN_PI / 2, some_eps);
  // The farthest that orientations can be apart: all four components equal, 2 pi/3; for semi-oriented frames pi.
  const Eigen::Quaterniond equal(0.5, 0.5, 0.5, 0.5);
  EXPECT_NEAR(distance(NonOrientedFrame3d(), NonOrientedFrame3d(equal, Eigen::Vector3d::Zero())), 2 * EIGEN_PI / 3,
              some_eps);
  EXPECT_NEAR(
      distance(SemiOrientedFrame3d(), SemiOrientedFrame3d(Eigen::Quaterniond(0, 1, 0, 0), Eigen::Vector3d::Zero())),
      EIGEN_PI, some_eps);
  // canonical() keeps the feature and takes the nearest representative.
  const NonOrientedFrame3d far(SO3d::rotX(3), Eigen::Vector3d(1, 2, 3)), near = far.canonical();
  EXPECT_EQ(distance(far, near), 0);
  EXPECT_NEAR(near.so3().log().norm(), EIGEN_PI - 3, some_eps);
}

}  // namespace
