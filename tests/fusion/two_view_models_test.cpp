// The models of two-view motion: their constraints, their covariances, and what the hierarchy makes of synthetic motions.
// `liestat validate two-view` has more trials.

#include <experiments/two_view_scene.hpp>
#include <fusion/two_view/models.hpp>
#include <stats/hierarchy.hpp>

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace {

using namespace liestat;
using experiments::TwoViewMotion;
using experiments::TwoViewScene;
using TwoViewHierarchy = Hierarchy<Eigen::Vector4d, TwoViewMotionModel>;

TwoViewImages imagesOf(const TwoViewScene& scene) {
  const auto& o = scene.options;
  return {{o.sigma / o.focal_length, o.sigma / o.focal_length}, Eigen::Vector2d(o.width, o.height) / o.focal_length};
}
std::shared_ptr<const TwoViewModel> modelOf(const TwoViewScene& scene) {
  for (const auto& model : twoViewModels(imagesOf(scene))) {
    if (model->name() == nameOf(scene.options.motion)) return model;
  }
  return nullptr;
}
/// The true parameter, of the sign of another one.
TwoViewMotionModel truthOf(const TwoViewScene& scene, const Eigen::Matrix3d& sign) {
  TwoViewMotionModel truth;
  truth.matrix = isEpipolar(scene.options.motion) ? scene.F : scene.H;
  if ((truth.matrix.array() * sign.array()).sum() < 0) truth.matrix = -truth.matrix;
  if (scene.options.motion == TwoViewMotion::essential) truth.pose = Essentiald(SO3d::fitToSO3(scene.R), scene.t);
  return truth;
}
/// eᵀ Σ⁺ e for a covariance of known rank.
double squaredDistance(const Eigen::VectorXd& error, const Eigen::MatrixXd& covariance, int rank) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(covariance);
  double sum = 0;
  for (int k = 0; k < rank; ++k) {
    const Eigen::Index i = covariance.rows() - 1 - k;
    sum += std::pow(eigen.eigenvectors().col(i).dot(error), 2) / eigen.eigenvalues()[i];
  }
  return sum;
}

TEST(TwoViewModels, EstimatesHaveTheCovarianceThatTheySay) {
  constexpr int trials = 60;
  for (const TwoViewMotion motion : experiments::default_two_view_motions) {
    double distance = 0, chi2 = 0, freedom = 0;
    int rank = 0, capped = 0;
    for (std::uint64_t seed = 0; seed < trials; ++seed) {
      const TwoViewScene scene({.motion = motion, .matches = 60, .outliers = 0}, 1000 + seed);
      const auto model = modelOf(scene);
      ASSERT_TRUE(model);
      rank = model->freeParameters();
      const TwoViewMotionModel truth = truthOf(scene, isEpipolar(motion) ? scene.F : scene.H);
      const auto found = model->estimate(truth, scene.matches, {});
      // Where one direction is hardly told, twenty steps may not do; what is reached is as good.
      ASSERT_TRUE(found.usable()) << nameOf(motion) << " " << seed;
      capped += found.status != Status::ok;
      // A few matches have a leverage that nobody vouches for.
      EXPECT_GE(found.measurements, 54u);
      EXPECT_EQ(found.degrees_of_freedom, model->equations() * static_cast<int>(found.measurements) - rank);
      chi2 += found.chi2, freedom += found.degrees_of_freedom;
      if (motion == TwoViewMotion::none) continue;
      if (motion == TwoViewMotion::essential) {
        // Both signs of the matrix and both rotations are the same epipolar geometry; the pose is on the right side.
        const Eigen::Matrix<double, 5, 1> e = log(found.parameter.pose, truth.pose);
        distance += squaredDistance(e, found.covariance, rank);
      } else {
        const Eigen::Matrix3d e = truthOf(scene, found.parameter.matrix).matrix - found.parameter.matrix;
        distance += squaredDistance(Eigen::Map<const Eigen::Matrix<double, 9, 1>>(e.data()), found.covariance, rank);
      }
    }
    EXPECT_LE(capped, 2) << nameOf(motion);
    // Variance 2k of a squared Mahalanobis distance of k dimensions; the curvature of the longest motions adds a few
    // per cent, as in the conic of constrained_test.
    EXPECT_NEAR(chi2 / freedom, 1, 4 * std::sqrt(2 / freedom) + 0.01) << nameOf(motion);
    if (rank > 0) {
      EXPECT_NEAR(distance / trials, rank, 4 * std::sqrt(2. * rank / trials) + 0.05 * rank) << nameOf(motion);
    }
  }
}

TEST(TwoViewModels, EstimatesObeyTheirConstraints) {
  for (const TwoViewMotion motion : experiments::default_two_view_motions) {
    const TwoViewScene scene({.motion = motion, .matches = 40, .outliers = 0}, 5);
    const auto model = modelOf(scene);
    const auto found = model->estimate(truthOf(scene, isEpipolar(motion) ? scene.F : scene.H), scene.matches, {});
    const Eigen::Matrix3d M = found.parameter.matrix;
    const auto near = [](const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) { return (a - b).norm() <= 1e-9; };
    const Eigen::Matrix2d top = M.topLeftCorner<2, 2>();
    Eigen::Matrix3d like = Eigen::Matrix3d::Identity();
    switch (motion) {
      case TwoViewMotion::retinal_displacement:
        EXPECT_LE((top * top.transpose() - Eigen::Matrix2d::Identity()).norm(), 1e-9);
        like.topLeftCorner<2, 2>() = top;
        [[fallthrough]];
      case TwoViewMotion::retinal_translation:
        like.topRightCorner<2, 1>() = M.topRightCorner<2, 1>();
        [[fallthrough]];
      case TwoViewMotion::none:
        EXPECT_TRUE(near(M, like)) << M;
        break;
      case TwoViewMotion::zoom:
        like.topLeftCorner<2, 2>() *= M(0, 0);
        EXPECT_TRUE(near(M, like)) << M;
        break;
      case TwoViewMotion::rotation:
        EXPECT_TRUE(near(M * M.transpose(), like));
        break;
      case TwoViewMotion::homography:
        EXPECT_NEAR(M.squaredNorm(), 3, 1e-9);
        break;
      case TwoViewMotion::translation:
        EXPECT_TRUE(near(M, -M.transpose()));
        [[fallthrough]];
      default:
        EXPECT_NEAR(M.squaredNorm(), 2, 1e-9);
        EXPECT_NEAR(M.determinant(), 0, 1e-9);
    }
    if (motion == TwoViewMotion::essential) {
      const Eigen::Matrix3d cubic = 2 * M * M.transpose() * M - (M * M.transpose()).trace() * M;
      EXPECT_LE(cubic.norm(), 1e-9);
      EXPECT_TRUE(near(M, found.parameter.pose.essentialMatrix()));
    }
  }
}

TEST(TwoViewModels, TheHierarchyFindsTheMotion) {
  // `validate two-view` has 50 trials a motion and more, of which 96 % are right on average.
  constexpr std::uint64_t trials = 5;
  std::size_t right = 0;
  for (const TwoViewMotion motion : experiments::default_two_view_motions) {
    std::size_t of_this = 0;
    for (std::uint64_t seed = 0; seed < trials; ++seed) {
      const TwoViewScene scene({.motion = motion}, seed);
      TwoViewHierarchy search(twoViewModels(imagesOf(scene)));
      ASSERT_TRUE(search.valid()) << search.fault();
      search.add(scene.matches);
      while (search.iterate()) {
      }
      const auto& found = search.state(search.best());
      if (search.models()[search.best()]->name() != nameOf(motion)) continue;
      ++of_this;
      // One in a hundred of 80 inliers lies beyond the threshold.
      EXPECT_GE(found.inliers.size(), 72u) << nameOf(motion) << " " << seed;
    }
    EXPECT_GE(of_this, trials - 1) << nameOf(motion);
    right += of_this;
  }
  EXPECT_GE(static_cast<double>(right), 0.93 * 9 * trials);
}

TEST(TwoViewModels, BadMatchesAreSaid) {
  const TwoViewImages images{{1e-3, 1e-3}, Eigen::Vector2d(1, 0.8)};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Eigen::Vector4d> line;
  for (int i = 0; i < 40; ++i) line.emplace_back(0.01 * i, 0.02 * i, 0.01 * i + 0.3, 0.02 * i - 0.1);
  const std::vector<std::pair<std::string, std::vector<Eigen::Vector4d>>> sets = {
      {"none", {}},
      {"none", {Eigen::Vector4d(0.1, 0.2, 0.3, 0.4)}},
      {"none", std::vector<Eigen::Vector4d>(30, Eigen::Vector4d::Constant(nan))},
      {"none", std::vector<Eigen::Vector4d>(30, Eigen::Vector4d(0.1, 0.2, 0.1, 0.2))},
      {"retinal translation", std::vector<Eigen::Vector4d>(30, Eigen::Vector4d(0.1, 0.2, 0.3, 0.4))},
      {"retinal translation", line}};
  for (const auto& [name, matches] : sets) {
    for (const TwoViewCalibration calibration : {TwoViewCalibration::calibrated, TwoViewCalibration::uncalibrated}) {
      TwoViewHierarchy search(twoViewModels(images, calibration));
      ASSERT_TRUE(search.valid()) << search.fault();
      search.add(matches);
      while (search.iterate()) {
      }
      EXPECT_EQ(search.models()[search.best()]->name(), name) << matches.size();
    }
  }
}

}  // namespace
