// The pose of a planar target: covariances against errors, from points with noise and from rendered images; the rival.

#include <fusion/targets/planar_pose.hpp>
#include <fusion/targets/target_pose.hpp>

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>
#include <vector>

#include <support/rendered_target.hpp>

namespace liestat {
namespace {

using testing::RenderedImage;
using testing::RenderedSheet;
using Vector6 = Eigen::Matrix<double, 6, 1>;

constexpr double degree = EIGEN_PI / 180;
const std::vector<Eigen::Vector2d> unit_square = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};

Camera lens(int width, int height, double focal) {
  Camera camera{.fu = focal, .fv = focal, .cu = (width - 1) / 2., .cv = (height - 1) / 2.};
  camera.distortion = Distortion::radtan;
  camera.coefficients << -0.1, 0.02, 0.001, -0.0005;
  camera.k3 = 0.01;
  camera.width = width, camera.height = height;
  return camera;
}

/// The corners of a square of `size` metres, with noise of `sigma` that is stated as `stated`.
PlanarView cornersOf(const SE3d& pose, const Camera& camera, double size, double sigma, double stated,
                     std::mt19937& rng) {
  std::normal_distribution<double> normal;
  PlanarView view;
  view.covariance.resize(8, 2);
  for (const Eigen::Vector2d& corner : unit_square) {
    const Eigen::Vector2d point = size / 2 * corner;
    view.covariance.middleRows<2>(2 * static_cast<Eigen::Index>(view.points.size())) =
        stated * stated * Eigen::Matrix2d::Identity();
    view.points.push_back(point);
    view.pixels.push_back(*camera.project(pose * Eigen::Vector3d(point.x(), point.y(), 0)) +
                          sigma * Eigen::Vector2d(normal(rng), normal(rng)));
  }
  return view;
}

double squaredError(const Gaussian<SE3d>& pose, const SE3d& truth) {
  const Vector6 error = (pose.mean.inverse() * truth).log();
  return error.dot(pose.covariance.ldlt().solve(error));
}

/// Normalised squared errors of poses that are ok.
struct Errors {
  double sum = 0, squares = 0, ok = 0, ambiguous = 0, withheld = 0, trials = 0;
  void add(const PlanarPoseResult& result, const SE3d& truth) {
    ++trials;
    // The rule that the status states.
    const bool excluded = !result.rival || result.likelihood_ratio >= min_likelihood_ratio;
    if (result.status == FusionStatus::ambiguous) {
      EXPECT_FALSE(excluded);
      EXPECT_TRUE(result.rival.has_value());
      ++ambiguous;
    }
    if (result.status == FusionStatus::undetermined) ++withheld;
    if (!result.ok()) return;
    EXPECT_TRUE(excluded);
    const double square = squaredError(result.pose, truth);
    sum += square, squares += square * square, ++ok;
  }
  double mean() const { return sum / ok; }
  double standardError() const { return std::sqrt((squares / ok - mean() * mean()) / ok); }
  void expectSix(const std::string& where) const {
    if (ok < 15) return;
    EXPECT_NEAR(mean(), 6, 0.3 + 4 * standardError()) << where;
  }
};

TEST(PlanarPose, ofPointsHasErrorsOfItsCovariance) {
  std::mt19937 rng(20);
  double all = 0;
  for (const double pixels : {2., 3., 5., 10., 40.}) {
    for (const double tilt : {0., 10., 20., 30., 45., 60., 75.}) {
      const Camera camera = lens(640, 480, 800);
      Errors errors;
      for (int i = 0; i < 300; ++i) {
        const SE3d truth = testing::renderedPose(camera, 0.01, pixels, tilt * degree, rng);
        const double sigma = 0.08 / std::sqrt(8 * pixels);
        errors.add(estimatePlanarPose(cornersOf(truth, camera, 0.08, sigma, sigma, rng), camera), truth);
      }
      errors.expectSix(std::to_string(pixels) + " px, " + std::to_string(tilt));
      all += errors.ok;
    }
  }
  EXPECT_GT(all, 0.6 * 35 * 300);
}

TEST(PlanarPose, namesTheRivalOfAFarTarget) {
  std::mt19937 rng(21);
  // Without perspective: both minima fit, and one of them is the truth.
  const Camera camera = lens(640, 480, 800);
  int named = 0;
  for (int i = 0; i < 200; ++i) {
    const SE3d truth = testing::renderedPose(camera, 0.01, 3, 35 * degree, rng);
    const PlanarPoseResult result = estimatePlanarPose(cornersOf(truth, camera, 0.08, 0.1, 0.1, rng), camera);
    if (result.status != FusionStatus::ambiguous) continue;
    ++named;
    ASSERT_TRUE(result.rival);
    EXPECT_LT(result.likelihood_ratio, min_likelihood_ratio);
    EXPECT_GT((result.pose.mean.inverse() * result.rival->mean).log().tail<3>().norm(), 20 * degree);
    const double nearer = std::min((result.pose.mean.inverse() * truth).log().tail<3>().norm(),
                                   (result.rival->mean.inverse() * truth).log().tail<3>().norm());
    EXPECT_LT(nearer, 15 * degree);
  }
  EXPECT_GT(named, 100);
}

TEST(PlanarPose, refutesNoiseThatIsStatedTooSmall) {
  std::mt19937 rng(22);
  const Camera camera = lens(640, 480, 800);
  int ok = 0;
  for (int i = 0; i < 1000; ++i) {
    const SE3d truth = testing::renderedPose(camera, 0.01, 20, 40 * degree, rng);
    // Two degrees of freedom: a factor of 100 leaves χ² below its quantile in 7 of 10 000 cases.
    const PlanarPoseResult result = estimatePlanarPose(cornersOf(truth, camera, 0.08, 1, 0.01, rng), camera);
    ok += result.ok();
    EXPECT_EQ(result.pose.covariance.allFinite(), result.ok());
  }
  EXPECT_LE(ok, 4);
}

TEST(PlanarPose, saysWhatIsWrongWithItsInput) {
  std::mt19937 rng(23);
  const Camera camera = lens(640, 480, 800);
  const PlanarView good = cornersOf(testing::renderedPose(camera, 0.01, 20, 0.7, rng), camera, 0.08, 0.1, 0.1, rng);
  ASSERT_TRUE(estimatePlanarPose(good, camera).ok());
  PlanarView view = good;
  view.points.pop_back(), view.pixels.pop_back();
  EXPECT_EQ(estimatePlanarPose(view, camera).fault, FaultKind::too_few_points);
  view = good, view.pixels[2].x() = std::nan("");
  EXPECT_EQ(estimatePlanarPose(view, camera).fault, Fault(FaultKind::bad_point, 2));
  view = good, view.covariance(0, 0) = -1;
  EXPECT_EQ(estimatePlanarPose(view, camera).fault, FaultKind::bad_pixel_noise);
  view = good, view.covariance = Eigen::MatrixXd::Identity(3, 3);
  EXPECT_EQ(estimatePlanarPose(view, camera).fault, FaultKind::bad_pixel_noise);
  view = good;
  for (Eigen::Vector2d& point : view.points) point.y() = 0;
  EXPECT_EQ(estimatePlanarPose(view, camera).status, FusionStatus::undetermined);
}

TEST(PlanarPose, isTheSameWithAJointCovariance) {
  std::mt19937 rng(24);
  const Camera camera = lens(640, 480, 800);
  PlanarView view = cornersOf(testing::renderedPose(camera, 0.01, 20, 0.7, rng), camera, 0.08, 0.1, 0.1, rng);
  const PlanarPoseResult blocks = estimatePlanarPose(view, camera);
  view.covariance = 0.01 * Eigen::MatrixXd::Identity(8, 8);
  const PlanarPoseResult joint = estimatePlanarPose(view, camera);
  EXPECT_LT((blocks.pose.mean.inverse() * joint.pose.mean).log().norm(), 1e-9);
  EXPECT_LT((blocks.pose.covariance - joint.pose.covariance).norm(), 1e-6 * joint.pose.covariance.norm());
}

/// A tag of random cells: a white rim, a black border, 6 × 6 bits.
RenderedSheet tagSheet(std::mt19937& rng) {
  RenderedSheet sheet{10, 10, {}, 0.01, {5, 5}};
  for (int i = 0; i < 100; ++i) {
    const int rim = std::min({i % 10, i / 10, 9 - i % 10, 9 - i / 10});
    sheet.white.push_back(rim == 0 ? 1 : rim == 1 ? 0 : static_cast<std::uint8_t>(rng() % 2));
  }
  return sheet;
}

/// A detector's finding: corners to a third of a pixel or a sixth of a cell.
SeenTarget seenTag(const RenderedSheet& sheet, const SE3d& pose, const Camera& camera, double pixels,
                   std::mt19937& rng) {
  std::normal_distribution<double> normal;
  SeenTarget seen{.id = 0, .pixels = {}, .side = 10, .border = 8, .cells = sheet.white};
  for (const Eigen::Vector2d& corner : unit_square) {
    const Eigen::Vector2d point = 0.04 * corner;
    seen.pixels.push_back(*camera.project(pose * Eigen::Vector3d(point.x(), point.y(), 0)) +
                          std::min(0.3, pixels / 6) * Eigen::Vector2d(normal(rng), normal(rng)));
  }
  return seen;
}

TEST(TargetPose, ofRenderedTagsHasErrorsOfItsCovariance) {
  const bool full = std::getenv("LIESTAT_FULL") != nullptr;
  if (full)
    std::puts("| px a cell | tilt, deg | ok | rival not excluded | withheld | NEES | s.e. |"), std::fflush(stdout);
  const Target target{.family = "36h11", .size = 0.08};
  std::mt19937 rng(30);
  for (const double pixels : full ? std::vector<double>{2, 3, 5, 10, 20, 40} : std::vector<double>{2, 6}) {
    for (const double tilt : full ? std::vector<double>{0, 15, 30, 45, 60, 75} : std::vector<double>{20, 55}) {
      const int side = std::max(96, static_cast<int>(18 * pixels) + 40);
      const Camera camera = lens(side, side, 1.7 * side);
      Errors errors;
      const int trials = full ? (pixels < 15 ? 200 : 60) : 25;
      for (int i = 0; i < trials; ++i) {
        const RenderedSheet sheet = tagSheet(rng);
        const SE3d truth = testing::renderedPose(camera, 0.01, pixels, tilt * degree, rng);
        const RenderedImage image = testing::renderSheets({{sheet, truth}}, camera, 4, 0.5, rng);
        errors.add(estimateTargetPose(image.view(), camera, target, seenTag(sheet, truth, camera, pixels, rng)).result,
                   truth);
      }
      if (full) {
        std::printf("| %g | %g | %.2f | %.2f | %.2f | %.2f | %.2f |\n", pixels, tilt, errors.ok / errors.trials,
                    errors.ambiguous / errors.trials, errors.withheld / errors.trials, errors.mean(),
                    errors.standardError());
        std::fflush(stdout);
      }
      errors.expectSix(std::to_string(pixels) + " px, " + std::to_string(tilt));
      EXPECT_GT(errors.ok, full ? -1 : 0.8 * trials) << pixels << " " << tilt;
    }
  }
}

TEST(TargetPose, ofAChessboardInAnyOrder) {
  const Target target{.kind = Target::Kind::chessboard, .columns = 5, .rows = 4, .family = {}, .size = 0.02};
  const Camera camera = lens(320, 240, 450);
  const RenderedSheet sheet = testing::chessboardSheet(5, 4, 0.02);
  std::mt19937 rng(31);
  std::normal_distribution<double> normal;
  Errors errors;
  for (int i = 0; i < 20; ++i) {
    SE3d truth = testing::renderedPose(camera, 0.02, 18, (10 + 2 * i) * degree, rng);
    truth = truth * SE3d::exp((Vector6() << -0.04, -0.03, 0, 0, 0, 0).finished());
    const RenderedImage image = testing::renderSheets({{sheet, truth}}, camera, 3, 0.6, rng);
    SeenTarget seen;
    for (int k = 0; k < 20; ++k) {
      seen.pixels.push_back(*camera.project(truth * Eigen::Vector3d(0.02 * (k % 5), 0.02 * (k / 5), 0)) +
                            0.3 * Eigen::Vector2d(normal(rng), normal(rng)));
    }
    // A detector may begin at any corner.
    if (i % 2 == 1) std::reverse(seen.pixels.begin(), seen.pixels.end());
    if (i % 4 > 1) {
      for (auto row = seen.pixels.begin(); row != seen.pixels.end(); row += 5) std::reverse(row, row + 5);
    }
    const TargetPose pose = estimateTargetPose(image.view(), camera, target, seen);
    EXPECT_GE(pose.points, 15U);
    EXPECT_NEAR(pose.noise, 3, 1);
    errors.add(pose.result, truth);
  }
  EXPECT_GE(errors.ok, 17);
  errors.expectSix("chessboard");
}

TEST(TargetPose, isNoneOfAnotherPattern) {
  std::mt19937 rng(32);
  const Camera camera = lens(200, 200, 300);
  const Target target{.family = "36h11", .size = 0.08};
  const RenderedSheet sheet = tagSheet(rng), other = tagSheet(rng);
  for (int i = 0; i < 10; ++i) {
    const SE3d truth = testing::renderedPose(camera, 0.01, 8, 30 * degree, rng);
    const RenderedImage image = testing::renderSheets({{sheet, truth}}, camera, 3, 0.6, rng);
    EXPECT_FALSE(estimateTargetPose(image.view(), camera, target, seenTag(other, truth, camera, 8, rng)).result.ok());
  }
  // Half of it lies beyond the image.
  const SE3d beside = SE3d::exp((Vector6() << 0.11, 0, 0.375, 0, 0, 0).finished());
  const RenderedImage image = testing::renderSheets({{sheet, beside}}, camera, 3, 0.6, rng);
  EXPECT_FALSE(estimateTargetPose(image.view(), camera, target, seenTag(sheet, beside, camera, 8, rng)).result.ok());
}

}  // namespace
}  // namespace liestat
