// SimpleManifold: poses of users, one without params(), one that is perturbed from the left. Their contract is checked
// with that of all manifolds (tests/manifolds.txt).

#include <lie/simple_manifold.hpp>

#include <support/jets.hpp>
#include <support/users_poses.hpp>

#include <gtest/gtest.h>

#include <limits>

namespace {

using liestat_test::DriverPose;
using liestat_test::LeftPose;
using Vector6 = Eigen::Matrix<double, 6, 1>;

static_assert(liestat::Metric<DriverPose<double>>);
static_assert(liestat::Homogeneous<LeftPose<double>> && !liestat::Metric<LeftPose<double>>);
static_assert(liestat::HasCompactFactor<DriverPose<double>> && liestat::HasChordalMoments<DriverPose<double>>);
static_assert(liestat::HasTangentParts<LeftPose<double>> && liestat::HasMetricTwin<LeftPose<double>>);

constexpr double eps = std::numeric_limits<double>::epsilon();

const Vector6 a = (Vector6() << 1, -2, 3, 0.4, -0.5, 0.6).finished(),
              b = (Vector6() << -1, 0.5, 0.2, -1.1, 0.3, 0.2).finished();

TEST(SimpleManifold, IsTheModelInOtherClothes) {
  using Traits = liestat::ManifoldTraits<DriverPose<double>>;
  const DriverPose<double> x = Traits::expOrigin(a), y = Traits::expOrigin(b);
  EXPECT_LT((liestat::log(x, y) - liestat::log(toFrame(x), toFrame(y))).norm(), 16 * eps);
  EXPECT_NEAR(liestat::distance(x, y), liestat::distance(toFrame(x), toFrame(y)), 16 * eps);
  Traits::ChordalMoments sums;
  sums.add(x, 0.3);
  ASSERT_TRUE(sums.mean());
  EXPECT_LT(liestat::distance(x, *sums.mean()), 16 * eps);
}

TEST(SimpleManifold, OfAnInverseIsPerturbedFromTheLeft) {
  const LeftPose<double> x{liestat::SE3d::exp(a)};
  const LeftPose<double> moved = liestat::exp(x, b);
  const liestat::SE3d expected = liestat::SE3d::exp(-b) * x.camera_T_world;
  EXPECT_LT((moved.camera_T_world.inverse() * expected).log().norm(), 32 * eps);
}

TEST(SimpleManifold, DifferentiatesThroughJets) {
  using liestat_test::Jet;
  using T = liestat::ManifoldTraits<DriverPose<Jet>>;
  for (const double scale : {0.0, 1e-9, 1.0}) {
    const Vector6 v = scale * a;
    const DriverPose<double> x = liestat::ManifoldTraits<DriverPose<double>>::expOrigin(v),
                             y = liestat::ManifoldTraits<DriverPose<double>>::expOrigin(b);
    const DriverPose<Jet> x_jet = T::expOrigin(v.cast<Jet>()), y_jet = T::expOrigin(b.cast<Jet>());
    const auto moved = liestat::exp(y_jet, liestat_test::variable<6>(Vector6::Zero()));
    liestat_test::expectNear(liestat_test::derivative(liestat::log(x_jet, moved)),
                             liestat::errorVector(x, y).by_feature, 1e-14, "log by the feature", scale);
  }
}

}  // namespace
