// Every operation of the groups differentiates through ceres::Jet, at zero, at tiny angles, in general and near pi, and
// the derivatives agree with the analytic Jacobians.

#include <support/jet_group.hpp>

namespace {

using namespace liestat_test;

TEST(Jet, SO2) { checkGroup<liestat::SO2>(0); }
TEST(Jet, SO3) { checkGroup<liestat::SO3>(0); }
TEST(Jet, SE2) { checkGroup<liestat::SE2>(2); }
TEST(Jet, SE3) { checkGroup<liestat::SE3>(3); }
TEST(Jet, SE23) { checkGroup<liestat::SE23>(3, {}, 3); }

TEST(Jet, RotationMatrices) {
  for (const double angle : swept_angles) {
    const liestat::SO3d x = liestat::SO3d::exp(tangent<3>(angle, 0));
    const liestat::SO3<Jet> moved = x.cast<Jet>() * liestat::SO3<Jet>::exp(variable<3>(Eigen::Vector3d::Zero()));
    const liestat::SO3<Jet> back(moved.matrix());
    expectNear(derivative((x.cast<Jet>().inverse() * back).log()), Eigen::Matrix3d::Identity(), some_eps, "matrix",
               angle);
  }
}

// The distance has a kink at zero, like |x|: its square does not.
TEST(Jet, SquaredDistance) {
  for (const double angle : swept_angles) {
    const Eigen::Vector3d v = tangent<3>(angle, 0);
    const auto z = liestat::log(liestat::SO3<Jet>(), liestat::SO3<Jet>::exp(variable<3>(v)));
    const Jet half = z.dot(z) * 0.5;
    EXPECT_LE((half.v.head<3>() - v).norm(), some_eps) << "gradient at angle " << angle;
  }
}

}  // namespace
