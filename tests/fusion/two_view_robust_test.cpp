// Robust estimates of one model: their covariances among outliers, their inliers, and what bad input gives.
// benchmarks/fusion/two_view_robust.cpp has more matches.

#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/detail/seven_points.hpp>
#include <fusion/two_view/robust.hpp>
#include <lie/detail/small_matrix.hpp>
#include <stats/gaussian.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace {

using namespace liestat;
using experiments::TwoViewMotion;
using experiments::TwoViewScene;

TwoViewScene sceneOf(TwoViewMotion motion, double outliers, std::uint64_t seed, std::size_t matches = 300) {
  return TwoViewScene({.motion = motion,
                       .matches = matches,
                       .outliers = outliers,
                       .sigma = 1,
                       .width = 1280,
                       .height = 960,
                       .focal_length = 800},
                      seed);
}
constexpr MatchNoise in_px{1, 1}, normalised{1. / 800, 1. / 800};

using Vector9 = Eigen::Matrix<double, 9, 1>;
Vector9 entriesOf(const Eigen::Matrix3d& M) { return Eigen::Map<const Vector9>(M.data()); }

/// eᵀ Σ⁺ e of the entries of H or F in normalised coordinates; Σ vanishes along the gradients of ‖·‖ and, for F, of det.
double distance(const TwoViewScene& scene, const Eigen::Matrix3d& M, Eigen::Matrix<double, 9, 9> covariance) {
  const bool epipolar = isEpipolar(scene.options.motion);
  Eigen::Matrix3d truth = epipolar ? scene.F : scene.H;
  if ((truth.array() * M.array()).sum() < 0) truth = -truth;
  const Vector9 norm = entriesOf(M).normalized(), determinant = entriesOf(detail::cofactors<double>(M)).normalized();
  const double size = covariance.trace();
  EXPECT_LE((covariance * norm).norm(), 1e-9 * size);
  covariance += size * norm * norm.transpose();
  if (epipolar) {
    EXPECT_LE((covariance * determinant).norm(), 1e-9 * size);
    covariance += size * determinant * determinant.transpose();
  }
  return mahalanobisSquared<double, 9>(entriesOf(M - truth), covariance);
}

struct Counts {
  std::size_t right = 0, missed = 0, wrong = 0;
  void add(const TwoViewScene& scene, const std::vector<std::size_t>& inliers) {
    std::vector<bool> found(scene.matches.size(), false);
    for (const std::size_t i : inliers) found[i] = true;
    for (std::size_t i = 0; i < found.size(); ++i) {
      right += scene.inlier[i] && found[i] ? 1U : 0U;
      missed += scene.inlier[i] && !found[i] ? 1U : 0U;
      wrong += !scene.inlier[i] && found[i] ? 1U : 0U;
    }
  }
};

/// Mean squared Mahalanobis distances of `trials` estimates of k dimensions: four standard errors, and a tenth for wrong
/// matches that fit by chance and for what first order does not see.
void expectConsistent(double mean, int k, int trials, const char* what, double outliers) {
  const double error = 4 * std::sqrt(2. * k / trials);
  EXPECT_LE(mean, 1.1 * k + error) << what << " " << outliers;
  EXPECT_GE(mean, k - error) << what << " " << outliers;
}

constexpr int trials = 40;

TEST(TwoViewRobust, HomographiesAreWithinTheirCovariance) {
  for (const double outliers : {0.3, 0.6}) {
    double sum = 0;
    Counts counts;
    for (std::uint64_t seed = 1; seed <= trials; ++seed) {
      const TwoViewScene scene = sceneOf(TwoViewMotion::homography, outliers, seed);
      const RobustHomography found = robustHomography(scene.matches, normalised);
      ASSERT_TRUE(found.ok()) << seed << " " << name(found.status);
      EXPECT_GE(found.confidence, 0.9999);
      EXPECT_NEAR(found.H.squaredNorm(), 3, 1e-12);
      sum += distance(scene, found.H, found.covariance);
      counts.add(scene, found.inliers);
    }
    expectConsistent(sum / trials, 8, trials, "homography", outliers);
    // χ²_{0.99} of right matches, and the parameter takes its share; of the wrong ones π 9.2·2 px² in the whole image.
    EXPECT_LE(counts.missed, 0.02 * static_cast<double>(counts.right)) << outliers;
    EXPECT_LE(counts.wrong, 5U) << outliers;
  }
}

TEST(TwoViewRobust, FundamentalMatricesAreWithinTheirCovariance) {
  for (const double outliers : {0.3, 0.6}) {
    double sum = 0;
    Counts counts;
    for (std::uint64_t seed = 1; seed <= trials; ++seed) {
      const TwoViewScene scene = sceneOf(TwoViewMotion::fundamental, outliers, seed);
      const RobustFundamental found = robustFundamental(scene.matches, normalised);
      ASSERT_TRUE(found.ok()) << seed << " " << name(found.status);
      EXPECT_NEAR(found.F.squaredNorm(), 2, 1e-12);
      EXPECT_LE(std::abs(found.F.determinant()), 1e-12);
      sum += distance(scene, found.F, found.covariance);
      counts.add(scene, found.inliers);
    }
    expectConsistent(sum / trials, 7, trials, "fundamental", outliers);
    EXPECT_LE(counts.missed, 0.03 * static_cast<double>(counts.right)) << outliers;
    // A band of some 2·2.6·√2 px in an image of 960.
    EXPECT_LE(counts.wrong, 0.015 * outliers * 300 * trials) << outliers;
  }
}

TEST(TwoViewRobust, PosesAreWithinTheirCovariance) {
  for (const double outliers : {0.3, 0.6}) {
    double sum = 0;
    Counts counts;
    for (std::uint64_t seed = 1; seed <= trials; ++seed) {
      const TwoViewScene scene = sceneOf(TwoViewMotion::essential, outliers, seed);
      const RobustEssential found = robustEssential(scene.matches, normalised);
      ASSERT_TRUE(found.ok()) << seed << " " << name(found.status);
      EXPECT_LE((found.E - found.pose.mean.essentialMatrix()).norm(), 1e-14);
      sum += mahalanobisSquared(found.pose, Essentiald(SO3d::fitToSO3(scene.R), scene.t));
      counts.add(scene, found.inliers);
    }
    expectConsistent(sum / trials, 5, trials, "essential", outliers);
    EXPECT_LE(counts.missed, 0.03 * static_cast<double>(counts.right)) << outliers;
    EXPECT_LE(counts.wrong, 0.015 * outliers * 300 * trials) << outliers;
  }
}

TEST(TwoViewRobust, SevenPointsAreSolvedAsByTheSolver) {
  const TwoViewScene scene = sceneOf(TwoViewMotion::fundamental, 0.3, 9);
  std::size_t solutions = 0, missed = 0, more = 0;
  for (std::size_t i = 0; i + 7 <= scene.matches.size(); i += 7) {
    const auto sample = std::span(scene.matches).subspan(i, 7);
    std::vector<Eigen::Matrix3d> found;
    detail::solveSevenPoints(sample,
                             [&](const Eigen::Matrix3d& F) { found.push_back(F * (std::sqrt(2.) / F.norm())); });
    const auto expected = solveFundamental(sample);
    for (const Eigen::Matrix3d& F : expected) {
      ++solutions;
      const auto same = [&](const Eigen::Matrix3d& G) {
        return std::abs(std::abs((F.array() * G.array()).sum()) - 2) < 1e-9;
      };
      missed += std::none_of(found.begin(), found.end(), same) ? 1U : 0U;
    }
    more += found.size() > expected.size() ? 1U : 0U;
  }
  EXPECT_GE(solutions, 60U);
  EXPECT_EQ(missed, 0U);
  EXPECT_EQ(more, 0U);
  // Equal matches determine nothing.
  detail::solveSevenPoints(std::vector<Eigen::Vector4d>(7, scene.matches[0]), [](const Eigen::Matrix3d&) { FAIL(); });
}

TEST(TwoViewRobust, AWrongStructureDoesNotHideTheRightOne) {
  // A camera that moves sideways, and wrong matches in the right row, as repeated structure gives them: most of them agree
  // with some geometry of nearly the same epipolar lines, which many right ones agree with, too. The true geometry scores
  // higher.
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    CounterRng random(seed);
    const SO3d R = SO3d::exp(Eigen::Vector3d(-0.02, 0.1, 0.01));
    const Eigen::Vector3d t(-0.5, 0.05, 0.1);
    std::vector<Eigen::Vector4d> matches;
    while (matches.size() < 300) {
      const double x = random.uniform(-0.8, 0.8), y = random.uniform(-0.6, 0.6), z = random.uniform(4, 10);
      const Eigen::Vector3d second = R * Eigen::Vector3d(x * z, y * z, z) + t;
      const Eigen::Vector2d u = second.hnormalized();
      if (std::abs(u.x()) > 0.8 || std::abs(u.y()) > 0.6) continue;
      matches.push_back(Eigen::Vector4d(x, y, u.x(), u.y()) + random.normalVector<4>() / 800);
      if (matches.size() % 3 == 0) matches.back()[2] = random.uniform(-0.8, 0.8);
    }
    const Essentiald truth(R, t);
    std::vector<double> errors(matches.size());
    epipolarErrors(truth.essentialMatrix(), matches, normalised, errors);
    double score = 0;
    for (const double e : errors) score += std::max(0.0, 1 - e / 6.6349);
    const RobustEssential found = robustEssential(matches, normalised, {.seed = seed});
    ASSERT_TRUE(found.ok());
    EXPECT_GT(found.score, 0.95 * score) << seed << ": a wrong one has four fifths";
    std::size_t missed = 200;
    for (const std::size_t i : found.inliers) missed -= (i + 1) % 3 != 0;
    EXPECT_LE(missed, 12U) << seed;
  }
}

TEST(TwoViewRobust, TheSeedIsTheResult) {
  const TwoViewScene scene = sceneOf(TwoViewMotion::essential, 0.4, 3);
  const RobustEssential a = robustEssential(scene.matches, normalised, {.seed = 7}),
                        b = robustEssential(scene.matches, normalised, {.seed = 7});
  EXPECT_EQ(a.E, b.E);
  EXPECT_EQ(a.inliers, b.inliers);
  EXPECT_EQ(a.draws, b.draws);
  // Another seed starts elsewhere and ends at the same minimum, to the tolerance of a hundredth of its deviation and the
  // shares of the last classes.
  const RobustEssential c = robustEssential(scene.matches, normalised, {.seed = 8});
  EXPECT_LE(mahalanobisSquared(a.pose, c.pose.mean), 0.05);
}

/// The covariance of the entries of left M right, of the norm that M has.
Eigen::Matrix<double, 9, 9> carried(const Eigen::Matrix3d& left, const Eigen::Matrix3d& right, const Eigen::Matrix3d& M,
                                    const Eigen::Matrix<double, 9, 9>& covariance) {
  const auto map = [&](const Eigen::Matrix3d& X) {
    const Eigen::Matrix3d Y = left * X * right;
    return Eigen::Matrix3d(Y * (M.norm() / Y.norm()));
  };
  Eigen::Matrix<double, 9, 9> J;
  for (int k = 0; k < 9; ++k) {
    Eigen::Matrix3d step = Eigen::Matrix3d::Zero();
    step(k % 3, k / 3) = 1e-4 * std::sqrt(covariance(k, k));
    const Eigen::Matrix3d column = (map(M + step) - map(M - step)) / (2 * step(k % 3, k / 3));
    J.col(k) = entriesOf(column);
  }
  return J * covariance * J.transpose();
}

TEST(TwoViewRobust, UnitsDoNotMatter) {
  Eigen::Matrix3d K;
  K << 800, 0, 640, 0, 800, 480, 0, 0, 1;
  const Eigen::Matrix3d back = K.inverse(), transposed = K.transpose();
  const auto expectSame = [](const TwoViewRobustResult& a, const TwoViewRobustResult& b) {
    ASSERT_TRUE(a.ok() && b.ok());
    EXPECT_EQ(a.inliers, b.inliers);
    EXPECT_EQ(a.draws, b.draws);
    EXPECT_NEAR(a.chi2, b.chi2, 1e-6 * b.chi2);
  };
  const TwoViewScene space = sceneOf(TwoViewMotion::fundamental, 0.3, 5);
  const RobustFundamental f = robustFundamental(space.pixels, in_px), g = robustFundamental(space.matches, normalised);
  expectSame(f, g);
  // Differences of numbers that the covariance of F in px holds to sixteen digits of its largest.
  EXPECT_LE((carried(transposed, K, f.F, f.covariance) - g.covariance).norm(), 1e-5 * g.covariance.norm());
  const TwoViewScene plane = sceneOf(TwoViewMotion::homography, 0.3, 5);
  const RobustHomography h = robustHomography(plane.pixels, in_px), k = robustHomography(plane.matches, normalised);
  expectSame(h, k);
  EXPECT_LE((back * h.H * K - k.H * ((back * h.H * K).norm() / k.H.norm())).norm(), 1e-6);
  EXPECT_LE((carried(back, K, h.H, h.covariance) - k.covariance).norm(), 1e-5 * k.covariance.norm());
}

TEST(TwoViewRobust, DifferentNoiseInTheTwoImages) {
  double sum = 0;
  for (std::uint64_t seed = 1; seed <= trials; ++seed) {
    const TwoViewScene scene = sceneOf(TwoViewMotion::homography, 0, seed, 60);
    CounterRng random(seed, 0, 7);
    std::vector<Eigen::Vector4d> matches;
    for (const Eigen::Vector4d& m : scene.exact) {
      const Eigen::Vector4d e = random.normalVector<4>();
      matches.emplace_back(m + e.cwiseProduct(Eigen::Vector4d(0.3, 0.3, 2, 2)) / 800);
    }
    const RobustHomography found = robustHomography(matches, {0.3 / 800, 2. / 800});
    ASSERT_TRUE(found.ok()) << seed;
    sum += distance(scene, found.H, found.covariance);
  }
  expectConsistent(sum / trials, 8, trials, "two noises", 0);
}

TEST(TwoViewRobust, DrawsThatRunOutAreSaid) {
  const TwoViewScene scene = sceneOf(TwoViewMotion::homography, 0.6, 2);
  const RobustHomography found = robustHomography(scene.pixels, in_px, {.max_draws = 60});
  EXPECT_EQ(found.draws, 60U);
  EXPECT_LT(found.confidence, 0.9999);
}

/// Each of the three gives that status, and neither a covariance nor inliers with it.
void expectStatus(const std::vector<Eigen::Vector4d>& matches, Status status, const char* what,
                  const MatchNoise& noise = in_px, TwoViewRobustOptions options = {}) {
  options.max_draws = std::min<std::size_t>(options.max_draws, 2000);
  const RobustHomography h = robustHomography(matches, noise, options);
  const RobustFundamental f = robustFundamental(matches, noise, options);
  const RobustEssential e = robustEssential(matches, noise, options);
  for (const Status found : {h.status, f.status, e.status}) EXPECT_STREQ(name(found), name(status)) << what;
  EXPECT_TRUE(h.covariance.array().isNaN().all() && f.covariance.array().isNaN().all()) << what;
  EXPECT_TRUE(e.pose.covariance.array().isNaN().all()) << what;
}

TEST(TwoViewRobust, BadInputIsSaid) {
  const std::vector<Eigen::Vector4d> good = sceneOf(TwoViewMotion::essential, 0, 1, 40).matches;
  expectStatus({}, Status::too_few, "nothing");
  expectStatus({good.begin(), good.begin() + 4}, Status::too_few, "four matches", normalised);
  constexpr double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  for (const double bad : {nan, infinity}) {
    auto matches = good;
    matches[7][2] = bad;
    expectStatus(matches, Status::not_applicable, "not finite", normalised);
  }
  for (const double bad : {0., -1., nan, infinity}) {
    expectStatus(good, Status::not_applicable, "noise", {bad, 1});
    expectStatus(good, Status::not_applicable, "noise", {1, bad});
  }
  for (const double bad : {0., 1., nan}) {
    expectStatus(good, Status::not_applicable, "confidence", normalised, {.confidence = bad});
  }
  for (const double bad : {-1., nan, infinity}) {
    expectStatus(good, Status::not_applicable, "threshold", normalised, {.threshold = bad});
  }
  expectStatus(good, Status::not_applicable, "draws", normalised, {.max_draws = 0});
  expectStatus(std::vector<Eigen::Vector4d>(30, good[3]), Status::ill_defined, "identical", normalised);
  expectStatus(std::vector<Eigen::Vector4d>(30, Eigen::Vector4d::Constant(1e200)), Status::ill_defined, "huge");
  std::vector<Eigen::Vector4d> line;
  for (int i = 0; i < 30; ++i) line.emplace_back(i, 2 * i, i + 3, 2 * i - 1);
  expectStatus(line, Status::ill_defined, "collinear");
}

TEST(TwoViewRobust, FewMatchesAreSaidOrEstimated) {
  std::size_t estimated = 0;
  for (std::size_t n = 0; n <= 20; ++n) {
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      std::vector<Eigen::Vector4d> matches = sceneOf(TwoViewMotion::essential, 0.2, seed, n).matches;
      // Some of them twice.
      if (seed == 4) std::copy_n(matches.begin(), n / 2, matches.begin() + static_cast<std::ptrdiff_t>(n - n / 2));
      const TwoViewRobustOptions options{.max_draws = 200};
      const RobustHomography h = robustHomography(matches, normalised, options);
      const RobustFundamental f = robustFundamental(matches, normalised, options);
      const RobustEssential e = robustEssential(matches, normalised, options);
      EXPECT_EQ(h.ok(), h.covariance.allFinite()) << n << " " << seed;
      EXPECT_EQ(f.ok(), f.covariance.allFinite()) << n << " " << seed;
      EXPECT_EQ(e.ok(), e.pose.covariance.allFinite()) << n << " " << seed;
      EXPECT_EQ(h.status == Status::too_few, n <= 4);
      EXPECT_EQ(f.status == Status::too_few, n <= 7);
      EXPECT_EQ(e.status == Status::too_few, n <= 5);
      for (const TwoViewRobustResult* found :
           {static_cast<const TwoViewRobustResult*>(&f), static_cast<const TwoViewRobustResult*>(&e)}) {
        EXPECT_LE(found->inliers.size(), n);
        estimated += found->ok() ? 1U : 0U;
      }
    }
  }
  EXPECT_GE(estimated, 40U);
}

TEST(TwoViewRobust, RandomMatchesAreNoModel) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    expectStatus(sceneOf(TwoViewMotion::essential, 1, seed, 200).matches, Status::ill_defined, "all wrong", normalised);
  }
}

TEST(TwoViewRobust, NoPoseWithoutTranslation) {
  for (const TwoViewMotion motion : {TwoViewMotion::none, TwoViewMotion::rotation}) {
    for (std::uint64_t seed = 1; seed <= 8; ++seed) {
      const double outliers = seed % 2 == 0 ? 0.3 : 0;
      const TwoViewScene scene = sceneOf(motion, outliers, seed);
      const RobustEssential found = robustEssential(scene.matches, normalised, {.max_draws = 2000});
      EXPECT_STREQ(name(found.status), "ill_defined") << nameOf(motion) << " " << outliers;
      const RobustEssential exact = robustEssential(scene.exact, normalised, {.max_draws = 2000});
      EXPECT_STREQ(name(exact.status), "ill_defined") << nameOf(motion) << " " << outliers;
    }
  }
}

}  // namespace
