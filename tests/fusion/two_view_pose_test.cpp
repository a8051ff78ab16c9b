// Five points, three with the vertical, poses of essential matrices and planes, focal lengths of fundamental matrices.

#include <fusion/two_view/errors.hpp>
#include <fusion/two_view/five_point.hpp>
#include <fusion/two_view/focal_lengths.hpp>
#include <fusion/two_view/pose.hpp>
#include <fusion/two_view/upright.hpp>
#include <support/two_view_checks.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace {

using namespace liestat_test;

double residual(const Eigen::Matrix3d& F, const Eigen::Vector4d& m) {
  return std::abs(Eigen::Vector3d(m[2], m[3], 1).dot(F * Eigen::Vector3d(m[0], m[1], 1)));
}

TEST(FivePoint, FindsTheTruth) {
  const SolverErrors errors = errorsOf(TwoViewMotion::essential, 5, 200, [](Matches m) { return solveEssential(m); });
  ASSERT_EQ(errors.sorted.size(), 4000U);
  EXPECT_GE(errors.shareBelow(1e-9), 0.999);
  EXPECT_LT(errors.quantile(0.5), 5e-14);
  EXPECT_LT(errors.quantile(0.99), 1e-11);
  EXPECT_GT(errors.solutions, 3);
  RecordProperty("median", std::to_string(1e15 * errors.quantile(0.5)) + "e-15");
  RecordProperty("p99", std::to_string(1e15 * errors.quantile(0.99)) + "e-15");
}

TEST(FivePoint, SolutionsAreEssentialAndMeetTheSample) {
  for (const TwoViewMotion motion :
       {TwoViewMotion::essential, TwoViewMotion::translation, TwoViewMotion::homography, TwoViewMotion::fundamental}) {
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
      // With noise, and with outliers too: any five matches.
      const TwoViewScene scene({.motion = motion, .outliers = 0.5}, seed);
      const Matches sample = Matches(scene.matches).first(5);
      const auto found = solveEssential(sample);
      for (std::size_t i = 0; i < found.size(); ++i) {
        const Eigen::Matrix3d& E = found[i];
        EXPECT_NEAR(E.squaredNorm(), 2, 1e-14);
        EXPECT_LT((2 * E * E.transpose() * E - 2 * E).norm(), 1e-13);
        EXPECT_LT(std::abs(E.determinant()), 1e-14);
        for (const Eigen::Vector4d& m : sample) EXPECT_LT(residual(E, m), 1e-13);
        for (std::size_t k = 0; k < i; ++k) EXPECT_GT(distance(E, found[k]), 1e-8);
      }
      // Complex roots come in pairs; two real ones closer than 1e-7 count once.
      EXPECT_EQ(found.size() % 2, 0U) << experiments::nameOf(motion) << seed;
    }
  }
}

TEST(FivePoint, PlanesAndTranslationsAreNoException) {
  for (const TwoViewMotion motion : {TwoViewMotion::homography, TwoViewMotion::translation}) {
    int found = 0, samples = 0;
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
      const TwoViewScene scene({.motion = motion, .outliers = 0}, seed);
      const Eigen::Matrix3d E = essentialFromPose({scene.R, scene.t});
      for (std::size_t i = 0; i + 5 <= 50; i += 5) {
        ++samples;
        found += nearest(solveEssential(Matches(scene.exact).subspan(i, 5)), E) < 1e-8 ? 1 : 0;
      }
    }
    EXPECT_GE(found, 0.995 * samples) << experiments::nameOf(motion);
  }
}

/// Smallest to largest singular value of the five equations' derivatives by the pose.
double conditionAt(const TwoViewPose& pose, Matches sample) {
  const Eigen::Vector3d p = pose.t.unitOrthogonal(), q = pose.t.cross(p);
  Eigen::Matrix<double, 5, 5> J;
  for (int i = 0; i < 5; ++i) {
    const Eigen::Vector4d& m = sample[static_cast<std::size_t>(i)];
    const Eigen::Vector3d v(m[2], m[3], 1), y = pose.R * Eigen::Vector3d(m[0], m[1], 1), n = y.cross(v);
    J.row(i) << y.cross(v.cross(pose.t)).transpose(), n.dot(p), n.dot(q);
  }
  const detail::SmallSvd svd(detail::SmallMatrix::of<5, 5>(J));
  return svd.value(4) / svd.value(0);
}

// Points of a grid and motions along axes make bases with zeros and solutions that share coordinates.
TEST(FivePoint, PointsOfAGrid) {
  for (const Eigen::Vector3d& way : {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 1, 1)}) {
    CounterRng random(5);
    const TwoViewPose pose{Eigen::Matrix3d::Identity(), way.normalized()};
    int well = 0, found = 0;
    const auto integer = [&](double low, double high) { return std::floor(random.uniform(low, high)); };
    for (int trial = 0; trial < 1000; ++trial) {
      std::vector<Eigen::Vector4d> sample;
      for (int i = 0; i < 5; ++i) {
        const double x = integer(-2, 3), y = integer(-2, 3), z = integer(4, 8);
        const Eigen::Vector3d second = Eigen::Vector3d(x, y, z) + 0.5 * way;
        sample.emplace_back(x / z, y / z, second.x() / second.z(), second.y() / second.z());
      }
      const auto solutions = solveEssential(sample);
      // Equal points, or all in one plane with a camera.
      if (solutions.empty() || conditionAt(pose, sample) < 1e-5) continue;
      ++well;
      found += nearest(solutions, essentialFromPose(pose)) < 1e-8 ? 1 : 0;
    }
    EXPECT_GT(well, 500);
    EXPECT_GE(found, 0.998 * well) << way.transpose();
  }
}

TEST(FivePoint, DegenerateSamplesHaveNoSolution) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (const TwoViewMotion motion : {TwoViewMotion::none, TwoViewMotion::rotation}) {
      const TwoViewScene scene({.motion = motion, .outliers = 0}, seed);
      EXPECT_TRUE(solveEssential(Matches(scene.exact).first(5)).empty()) << experiments::nameOf(motion) << seed;
    }
    const TwoViewScene scene({.outliers = 0}, seed);
    std::vector<Eigen::Vector4d> sample(scene.exact.begin(), scene.exact.begin() + 5);
    ASSERT_FALSE(solveEssential(sample).empty());
    EXPECT_TRUE(solveEssential(Matches(sample).first(4)).empty());
    EXPECT_TRUE(solveEssential(Matches(scene.exact).first(6)).empty());
    std::vector<Eigen::Vector4d> twice = sample;
    twice[3] = twice[1];
    EXPECT_TRUE(solveEssential(twice).empty());
    EXPECT_TRUE(solveEssential(std::vector<Eigen::Vector4d>(5, sample[0])).empty());
    for (int k = 0; k < 4; ++k) {
      std::vector<Eigen::Vector4d> broken = sample;
      broken[2][k] = nan;
      EXPECT_TRUE(solveEssential(broken).empty());
      broken[2][k] = std::numeric_limits<double>::infinity();
      EXPECT_TRUE(solveEssential(broken).empty());
    }
  }
}

TEST(Upright, FindsTheTruth) {
  std::vector<double> errors;
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    CounterRng random(seed, 0, 9);
    const Eigen::Vector3d up = random.uniform(0.1, 10) * random.unitVector<3>();
    const TwoViewScene scene({.outliers = 0}, seed);
    for (std::size_t i = 0; i + 3 <= 60; i += 3) {
      const Matches sample = Matches(scene.exact).subspan(i, 3);
      const auto found = solveEssentialUpright(sample, up, 3 * scene.R * up);
      errors.push_back(nearest(found, scene.F));
      for (const Eigen::Matrix3d& E : found) {
        EXPECT_NEAR(E.squaredNorm(), 2, 1e-13);
        for (const Eigen::Vector4d& m : sample) EXPECT_LT(residual(E, m), 1e-9);
        // The rotation keeps the vertical: E = [t]× R, one of two rotations.
        double kept = 1;
        for (const TwoViewPose& pose : posesOfEssential(E)) {
          kept = std::min(kept, (pose.R * up.normalized() - scene.R * up.normalized()).norm());
        }
        EXPECT_LT(kept, 1e-7);
      }
    }
  }
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 1e-13);
  EXPECT_LT(errors[errors.size() - 3], 1e-9);
}

TEST(Upright, DegenerateSamplesHaveNoSolution) {
  const Eigen::Vector3d up(0.1, -1, 0.2);
  for (const TwoViewMotion motion : {TwoViewMotion::none, TwoViewMotion::rotation}) {
    const TwoViewScene scene({.motion = motion, .outliers = 0}, 3);
    for (std::size_t k = 0; k < 90; k += 3) {
      EXPECT_TRUE(solveEssentialUpright(Matches(scene.exact).subspan(k, 3), up, scene.R * up).empty());
    }
  }
  const TwoViewScene scene({.outliers = 0}, 3);
  std::vector<Eigen::Vector4d> sample(scene.exact.begin(), scene.exact.begin() + 3);
  ASSERT_FALSE(solveEssentialUpright(sample, up, scene.R * up).empty());
  // Along the y axis the other way: half a turn.
  const Eigen::Vector3d down = -Eigen::Vector3d::UnitY();
  EXPECT_LT(nearest(solveEssentialUpright(sample, down, scene.R * down), scene.F), 1e-9);
  EXPECT_TRUE(solveEssentialUpright(sample, Eigen::Vector3d::Zero(), up).empty());
  EXPECT_TRUE(solveEssentialUpright(sample, up, Eigen::Vector3d::Constant(std::nan(""))).empty());
  EXPECT_TRUE(solveEssentialUpright(Matches(sample).first(2), up, scene.R * up).empty());
  sample[1] = sample[0];
  EXPECT_TRUE(solveEssentialUpright(sample, up, scene.R * up).empty());
  sample[1][2] = std::nan("");
  EXPECT_TRUE(solveEssentialUpright(sample, up, scene.R * up).empty());
}

TEST(TwoViewPose, EssentialMatrixGivesThePoseBack) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const TwoViewScene scene({.outliers = 0}, seed);
    const double sign = seed % 2 == 0 ? 1e3 : -1e-3;
    const CheiralPose chosen = poseByCheirality(sign * scene.F, scene.exact);
    EXPECT_LT((chosen.pose.R - scene.R).norm(), 1e-13);
    EXPECT_LT((chosen.pose.t - scene.t.normalized()).norm(), 1e-13);
    EXPECT_EQ(chosen.in_front, 100U);
    std::size_t sum = 0;
    const auto poses = posesOfEssential(scene.F);
    ASSERT_EQ(poses.size(), 4U);
    const auto reference = decomposeEssential(Eigen::Matrix3d(scene.F));
    for (std::size_t i = 0; i < 4; ++i) {
      sum += chosen.counts[i];
      EXPECT_LT((poses[i].R - reference[i].so3().matrix()).norm(), 1e-13);
      EXPECT_LT((poses[i].t - reference[i].direction().unit_vector()).norm(), 1e-13);
      EXPECT_LT(
          std::min((essentialFromPose(poses[i]) - scene.F).norm(), (essentialFromPose(poses[i]) + scene.F).norm()),
          1e-13);
    }
    // A point lies in front for one of the four, and for no other.
    EXPECT_EQ(sum, 100U);
    // The essential manifold, and back.
    const Essentiald essential = toEssential({scene.R, scene.t});
    EXPECT_LT((essential.essentialMatrix() - essentialFromPose({scene.R, scene.t.normalized()})).norm(), 1e-14);
    EXPECT_LT((toPose(essential).R - scene.R).norm(), 1e-14);
    EXPECT_LT((toPose(essential).t - scene.t.normalized()).norm(), 1e-14);
  }
}

TEST(TwoViewPose, PointsAtInfinityCountForNone) {
  const TwoViewScene scene({.outliers = 0}, 4);
  std::vector<Eigen::Vector4d> far;
  for (const Eigen::Vector4d& m : scene.exact) {
    Eigen::Vector4d turned = m;
    turned.tail<2>() = transferred(scene.R, m);
    far.push_back(turned);
  }
  EXPECT_EQ(poseByCheirality(scene.F, far).in_front, 0U);
  for (const Eigen::Vector4d& m : far) EXPECT_EQ(sideOf({scene.R, scene.t}, m), 0);
  // As many in front as without them; behind, the two rays meet at negative depths.
  far.insert(far.end(), scene.exact.begin(), scene.exact.end());
  EXPECT_EQ(poseByCheirality(scene.F, far).in_front, 100U);
  EXPECT_EQ(sideOf({scene.R, -scene.t}, scene.exact[0]), -1);
  EXPECT_TRUE(posesOfEssential(Eigen::Matrix3d::Zero()).empty());
  EXPECT_TRUE(posesOfEssential(Eigen::Matrix3d::Constant(std::nan(""))).empty());
  EXPECT_EQ(poseByCheirality(Eigen::Matrix3d::Zero(), far).in_front, 0U);
}

TEST(TwoViewPose, HomographyGivesThePlaneBack) {
  int two = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const TwoViewScene scene({.motion = TwoViewMotion::homography, .outliers = 0}, seed);
    const auto found = posesOfHomography((seed % 2 == 0 ? -3 : 0.2) * scene.H, scene.exact);
    two += found.size() == 2 ? 1 : 0;
    double best = 1;
    for (const PlanePose& plane : found) {
      // Each is a decomposition, with a rotation.
      const Eigen::Matrix3d H = plane.pose.R + plane.pose.t * plane.n.transpose();
      EXPECT_LT(distance(H, scene.H), 1e-13);
      EXPECT_LT((plane.pose.R.transpose() * plane.pose.R - Eigen::Matrix3d::Identity()).norm(), 1e-13);
      EXPECT_GT(plane.pose.R.determinant(), 0);
      EXPECT_NEAR(plane.n.norm(), 1, 1e-14);
      best = std::min(best, (plane.pose.R - scene.R).norm() + (plane.n - scene.plane_normal).norm() +
                                (plane.pose.t - scene.t / scene.plane_distance).norm());
    }
    EXPECT_LT(best, 1e-11) << seed;
    ASSERT_FALSE(found.empty());
    EXPECT_EQ(found[0].in_front, 100U);
    // Without matches the normal points away from the first camera.
    for (const PlanePose& plane : posesOfHomography(scene.H)) EXPECT_GE(plane.n.z(), 0);
  }
  EXPECT_GT(two, 195);
}

TEST(TwoViewPose, SpecialHomographies) {
  const Eigen::Matrix3d R = SO3d::exp(Eigen::Vector3d(0.1, -0.2, 0.05)).matrix();
  const auto turned = posesOfHomography(5 * R);
  ASSERT_EQ(turned.size(), 1U);
  EXPECT_LT((turned[0].pose.R - R).norm(), 1e-14);
  EXPECT_EQ(turned[0].pose.t.norm(), 0);
  // Towards the plane along its normal, and away from it: one solution.
  const Eigen::Vector3d n = Eigen::Vector3d(0.2, -0.1, 1).normalized();
  for (const double way : {-0.3, 0.3}) {
    const auto along = posesOfHomography(R + way * (R * n) * n.transpose());
    ASSERT_EQ(along.size(), 1U);
    EXPECT_LT((along[0].pose.R - R).norm(), 1e-7);
    EXPECT_LT((along[0].n - n).norm(), 1e-7);
    EXPECT_LT((along[0].pose.t - way * R * n).norm(), 1e-7);
  }
  EXPECT_TRUE(posesOfHomography(Eigen::Matrix3d::Zero()).empty());
  EXPECT_TRUE(posesOfHomography(Eigen::Matrix3d(n * n.transpose())).empty());
  EXPECT_TRUE(posesOfHomography(Eigen::Matrix3d::Constant(std::nan(""))).empty());
}

/// cᵀ (D V Dᵀ)⁻¹ c of equations c of a match, D by central differences: of equations that are at most quadratic in each
/// coordinate these are exact but for rounding, 1e-16 over the step.
template <int N, class Equations>
double sampsonError(const Equations& c, const Eigen::Vector4d& m, const MatchNoise& noise) {
  constexpr double h = 1e-2;
  Eigen::Matrix<double, N, 4> D;
  for (int k = 0; k < 4; ++k) {
    const Eigen::Vector4d step = h * Eigen::Vector4d::Unit(k);
    D.col(k) = (c(Eigen::Vector4d(m + step)) - c(Eigen::Vector4d(m - step))) / (2 * h);
  }
  const double a = noise.first * noise.first, b = noise.second * noise.second;
  const Eigen::Matrix<double, N, N> V = D * Eigen::Vector4d(a, a, b, b).asDiagonal() * D.transpose();
  return c(m).dot(V.inverse() * c(m));
}

TEST(TwoViewErrors, AreThoseOfTheEquationsUnderUnequalNoises) {
  for (std::uint64_t trial = 0; trial < 20; ++trial) {
    CounterRng rng(31, trial);
    Eigen::Matrix3d H, F;
    for (int k = 0; k < 3; ++k) H.col(k) = rng.normalVector<3>(), F.col(k) = rng.normalVector<3>();
    H = 0.3 * H + 2 * Eigen::Matrix3d::Identity();
    const Eigen::Vector4d m = 0.7 * rng.normalVector<4>();
    const MatchNoise noise{0.01, 0.03};
    const auto mapped = [&](const Eigen::Vector4d& at) {
      const Eigen::Vector3d y = H * Eigen::Vector3d(at[0], at[1], 1);
      return Eigen::Vector2d(y.z() * at.tail<2>() - y.head<2>());
    };
    const auto onLine = [&](const Eigen::Vector4d& at) {
      return Eigen::Matrix<double, 1, 1>(Eigen::Vector3d(at[2], at[3], 1).dot(F * Eigen::Vector3d(at[0], at[1], 1)));
    };
    ASSERT_GT((H * Eigen::Vector3d(m[0], m[1], 1)).z(), 0) << trial;
    const double homography = sampsonError<2>(mapped, m, noise), epipolar = sampsonError<1>(onLine, m, noise);
    EXPECT_NEAR(homographyError(H, m, noise), homography, 1e-9 * homography) << trial;
    EXPECT_NEAR(epipolarError(F, m, noise), epipolar, 1e-9 * epipolar) << trial;
  }
}

TEST(FocalLengths, PhysicalFormGivesTheFundamentalMatrixBack) {
  int told = 0;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    const TwoViewScene scene({.motion = TwoViewMotion::fundamental, .outliers = 0}, seed);
    const PhysicalMotion truth{{1, scene.focal_ratio}, {scene.R, scene.t.normalized()}};
    EXPECT_LT(distance(fundamentalFromMotion(truth), scene.F), 1e-14);
    const auto found = motionFromFundamental((seed % 2 == 0 ? -1 : 1) * scene.F, scene.exact);
    if (!found) continue;
    // A rotation of 3 to 12 degrees tells focal lengths badly; digits are lost, but F is met.
    const double lost = std::abs(found->focal.first - 1) + std::abs(found->focal.second - scene.focal_ratio);
    EXPECT_LT(distance(fundamentalFromMotion(*found), scene.F), 1e-6);
    EXPECT_LT(lost, 1e-5) << seed;
    EXPECT_LT((found->pose.R - scene.R).norm(), 1e-5);
    EXPECT_LT((found->pose.t - scene.t.normalized()).norm(), 1e-5);
    ++told;
  }
  EXPECT_GE(told, 198);
}

TEST(FocalLengths, AxesThatMeetTellNothing) {
  const TwoViewScene scene({.motion = TwoViewMotion::translation, .outliers = 0}, 3);
  EXPECT_FALSE(focalLengths(scene.F));
  // A camera that turns about a point of its axis: both axes pass through it.
  const Eigen::Matrix3d R = SO3d::exp(Eigen::Vector3d(0.1, -0.2, 0.3)).matrix();
  const Eigen::Vector3d c(0, 0, 5), t = c - R * c;
  EXPECT_FALSE(focalLengths(essentialFromPose({R, t})));
  EXPECT_FALSE(focalLengths(Eigen::Matrix3d::Zero()));
  EXPECT_FALSE(focalLengths(Eigen::Matrix3d::Constant(std::nan(""))));
  EXPECT_FALSE(motionFromFundamental(Eigen::Matrix3d::Zero(), scene.exact));
}

}  // namespace
