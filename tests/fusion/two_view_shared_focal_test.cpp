// Poses with a focal length that both views share, and poses that keep the vertical: solver, derivatives, and the
// motions that do not tell the focal length.

#include <experiments/two_view_lattice.hpp>
#include <fusion/two_view/detail/two_view_constraints.hpp>
#include <fusion/two_view/models.hpp>
#include <fusion/two_view/shared_focal.hpp>
#include <stats/hierarchy.hpp>
#include <support/two_view_checks.hpp>

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace {

using namespace liestat_test;

SharedFocalMotion truthOf(const TwoViewScene& scene) {
  return {Essentiald(SO3d::fitToSO3(scene.R), scene.t), scene.focal_scale};
}

TEST(TwoViewSharedFocal, FindsTheTruthFromSevenMatches) {
  double worst_focal = 0;
  const auto solve = [](Matches sample) {
    Solutions<Eigen::Matrix3d, 3> found;
    for (const SharedFocalMotion& motion : solveSharedFocal(sample)) found.add(fundamentalFromMotion(motion));
    return found;
  };
  const SolverErrors errors = errorsOf(TwoViewMotion::shared_focal, 7, 25, solve);
  EXPECT_GE(errors.shareBelow(1e-9), 0.999);
  EXPECT_LT(errors.quantile(0.5), 1e-13);
  EXPECT_LT(errors.solutions, 3);
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const TwoViewScene scene({.motion = TwoViewMotion::shared_focal, .outliers = 0}, seed);
    // Closed form of the exact matrix, of any scale and sign.
    const auto f = sharedFocalLength(-7 * scene.F);
    ASSERT_TRUE(f) << seed;
    worst_focal = std::max(worst_focal, std::abs(*f / scene.focal_scale - 1));
  }
  EXPECT_LT(worst_focal, 1e-9);
}

TEST(TwoViewSharedFocal, BadSamplesHaveNoSolution) {
  const TwoViewScene scene({.motion = TwoViewMotion::shared_focal, .outliers = 0}, 4);
  EXPECT_TRUE(solveSharedFocal({}).empty());
  EXPECT_TRUE(solveSharedFocal(Matches(scene.exact).first(6)).empty());
  EXPECT_TRUE(solveSharedFocal(std::vector<Eigen::Vector4d>(7, scene.exact[0])).empty());
  std::vector<Eigen::Vector4d> broken(scene.exact.begin(), scene.exact.begin() + 7);
  broken[3][1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(solveSharedFocal(broken).empty());
  EXPECT_FALSE(sharedFocalLength(Eigen::Matrix3d::Zero()));
  EXPECT_FALSE(sharedFocalLength(Eigen::Matrix3d::Constant(std::numeric_limits<double>::quiet_NaN())));
  // Parallel optical axes: every focal length does.
  const SharedFocalMotion parallel{Essentiald(SO3d::exp(Eigen::Vector3d(0, 0, 0.3)), Eigen::Vector3d(1, 2, 0.5)), 1.7};
  EXPECT_FALSE(sharedFocalLength(fundamentalFromMotion(parallel)));
}

// Central differences with h = 1e-5: h² and rounding, 1e-10.
TEST(TwoViewSharedFocal, DerivativesAreThoseOfDifferences) {
  constexpr double h = 1e-5;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const TwoViewScene scene({.motion = TwoViewMotion::shared_focal, .matches = 10, .outliers = 0}, seed);
    const SharedFocalMotion motion = truthOf(scene);
    const auto J = fundamentalJacobian(motion);
    for (int k = 0; k < 6; ++k) {
      const auto at = [&](double step) {
        SharedFocalMotion moved = motion;
        if (k < 5) {
          moved.pose = exp(motion.pose, Eigen::Matrix<double, 5, 1>(step * Eigen::Matrix<double, 5, 1>::Unit(k)));
        } else {
          moved.focal_length *= std::exp(step);
        }
        return detail::entriesFrom(fundamentalFromMotion(moved));
      };
      const detail::Entries above = at(h), below = at(-h);
      EXPECT_LE(((above - below) / (2 * h) - J.col(k)).norm(), 1e-8 * (1 + J.col(k).norm())) << k;
    }
  }
}

TEST(TwoViewUpright, ConstraintKeepsTheVertical) {
  constexpr double h = 1e-5;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const TwoViewScene scene({.motion = TwoViewMotion::upright, .matches = 10, .outliers = 0}, seed);
    const Essentiald truth(SO3d::fitToSO3(scene.R), scene.t);
    // Verticals of any length.
    const detail::UprightConstraint constraint({2 * scene.vertical, 0.3 * scene.R * scene.vertical});
    EXPECT_LE(constraint(truth).norm(), 1e-14);
    // Off the solution, too.
    const Essentiald near = exp(truth, Eigen::Matrix<double, 5, 1>({0.1, -0.2, 0.1, 0.2, -0.1}));
    EXPECT_GE(constraint(near).norm(), 0.01);
    const auto at = constraint.linearize(near);
    for (int k = 0; k < 5; ++k) {
      const Eigen::Matrix<double, 5, 1> step = h * Eigen::Matrix<double, 5, 1>::Unit(k), back = -step;
      const Eigen::Vector2d above = constraint(exp(near, step)), below = constraint(exp(near, back));
      EXPECT_LE(((above - below) / (2 * h) - at.by_parameter.col(k)).norm(), 1e-9) << k;
    }
    // Two independent rows: three parameters stay free.
    const auto rows = constraint.linearize(truth).by_parameter;
    EXPECT_GT((rows * rows.transpose()).determinant(), 0.5);
  }
}

/// Noisy matches of points at 3 to 9 m seen by a pose and a focal length.
std::vector<Eigen::Vector4d> matchesOf(const SharedFocalMotion& motion, double scale, std::uint64_t seed) {
  CounterRng random(seed);
  std::vector<Eigen::Vector4d> matches;
  const double f = motion.focal_length;
  const TwoViewPose pose = toPose(motion.pose);
  while (matches.size() < 80) {
    const double x = random.uniform(-0.5, 0.5), y = random.uniform(-0.4, 0.4), depth = random.uniform(3, 9);
    const Eigen::Vector4d noise = 0.5 / 600 * random.normalVector<4>();
    const Eigen::Vector3d second = pose.R * (depth * Eigen::Vector3d(x / f, y / f, 1)) + scale * pose.t;
    if (!(second.z() > 0.5)) continue;
    matches.push_back(Eigen::Vector4d(x, y, f * second.x() / second.z(), f * second.y() / second.z()) + noise);
  }
  return matches;
}
ModelEstimate<TwoViewMotionModel> sharedFocalEstimate(const SharedFocalMotion& start,
                                                      const std::vector<Eigen::Vector4d>& matches) {
  const TwoViewImages images{{0.5 / 600, 0.5 / 600}, Eigen::Vector2d(1, 0.8)};
  TwoViewMotionModel parameter;
  parameter.matrix = fundamentalFromMotion(start);
  parameter.focal_length = start.focal_length;
  for (const auto& model : twoViewModels(images, {.nodes = {TwoViewNode::shared_focal}})) {
    if (model->name() == "shared focal length") return model->estimate(parameter, matches, {});
  }
  return {};
}

TEST(TwoViewSharedFocal, MotionsThatDoNotTellItAreRefused) {
  const auto refused = [](const auto& found) {
    return !found.usable() && found.status == Status::not_applicable && found.covariance.size() == 0;
  };
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    CounterRng random(seed, 1);
    const Eigen::Vector3d turn = 0.25 * random.unitVector<3>(), direction = random.unitVector<3>();
    // A point of the first optical axis, seen by the second, nearer or farther.
    const double near = random.uniform(3, 4), far = random.uniform(5, 6);
    const SO3d R = SO3d::exp(turn);
    const Eigen::Vector3d meeting = far * (R.matrix() * Eigen::Vector3d::UnitZ());
    const Eigen::Vector3d t = near * Eigen::Vector3d::UnitZ() - meeting;
    const SharedFocalMotion meets{Essentiald(R, t), 1.3},
        parallel{Essentiald(SO3d::exp(Eigen::Vector3d(0, 0, 0.2)), direction), 1.3};
    EXPECT_TRUE(refused(sharedFocalEstimate(meets, matchesOf(meets, t.norm(), seed)))) << seed;
    EXPECT_TRUE(refused(sharedFocalEstimate(parallel, matchesOf(parallel, 1, seed)))) << seed;
    const TwoViewScene plane({.motion = TwoViewMotion::homography, .matches = 80, .outliers = 0.05}, seed);
    EXPECT_TRUE(refused(sharedFocalEstimate(truthOf(plane), plane.matches))) << seed;
    // The same motion as the first, turned so that the axes pass each other.
    const SharedFocalMotion general{Essentiald(R, Eigen::Vector3d(t.y() + 1, 1.5 - t.x(), 0.3 * t.z())), 1.3};
    const double apart = general.pose.essentialMatrix()(2, 2);
    if (std::abs(apart) < 0.05) continue;
    const auto found = sharedFocalEstimate(general, matchesOf(general, 1.5, seed));
    ASSERT_TRUE(found.usable()) << seed << " " << apart;
    EXPECT_LE(std::abs(std::log(found.parameter.focal_length / 1.3)), 5 * std::sqrt(found.covariance(5, 5))) << seed;
  }
}

TEST(TwoViewSharedFocal, TakesThePlaceOfEssentialWithoutCalibration) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const TwoViewScene scene({.motion = TwoViewMotion::shared_focal}, seed);
    Hierarchy<Eigen::Vector4d, TwoViewMotionModel> search(
        twoViewModels(experiments::imagesOf(scene.options),
                      {.calibration = TwoViewCalibration::uncalibrated, .nodes = {TwoViewNode::shared_focal}}));
    search.add(scene.matches);
    while (search.iterate()) {
    }
    const auto& best = search.state(search.best());
    ASSERT_EQ(search.models()[search.best()]->name(), "shared focal length") << seed;
    ASSERT_EQ(best.estimate.covariance.rows(), 6);
    EXPECT_LE(std::abs(std::log(best.estimate.parameter.focal_length / scene.focal_scale)),
              5 * std::sqrt(best.estimate.covariance(5, 5)));
  }
}

}  // namespace
