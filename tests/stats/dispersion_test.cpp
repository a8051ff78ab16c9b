#include <lie/frame3.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/so2.hpp>
#include <lie/so3.hpp>
#include <stats/concentration.hpp>
#include <stats/covariance.hpp>
#include <stats/dispersion.hpp>
#include <stats/mean.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <list>
#include <vector>

namespace {

using namespace liestat;

constexpr double pi = static_cast<double>(EIGEN_PI);

TEST(Dispersion, OfPointsIsTheirSecondMoment) {
  const std::vector<Eigen::Vector3d> points{{1, 0, 0}, {-1, 0, 0}, {0, 2, 0}, {0, -2, 0}};
  const auto plain = dispersionAbout(points, Eigen::Vector3d(0, 0, 0));
  EXPECT_TRUE(plain.covariance.isApprox(Eigen::Vector3d(0.5, 2, 0).asDiagonal().toDenseMatrix(), 1e-15));
  ASSERT_EQ(plain.farthest.size(), 1u);
  EXPECT_DOUBLE_EQ(plain.farthest[0].distance, 2);
  EXPECT_EQ(plain.farthest[0].index, 2u) << "the first of two that are equally far";

  const auto weighted = dispersionAbout(points, std::vector<double>{3, 3, 1, 1}, Eigen::Vector3d(0, 0, 0));
  EXPECT_TRUE(weighted.covariance.isApprox(Eigen::Vector3d(0.75, 1, 0).asDiagonal().toDenseMatrix(), 1e-15));
}

TEST(Dispersion, OfNothingIsNotANumber) {
  const auto none = dispersionAbout(std::vector<Eigen::Vector3d>(), Eigen::Vector3d(0, 0, 0));
  EXPECT_TRUE(none.covariance.hasNaN());
}

TEST(Dispersion, NamesTheFarthestInEachPartOfATangentVector) {
  const Frame3d y(SO3d::exp({0.3, -0.2, 1}), {1, 2, 3});
  std::list<Frame3d> frames;  // whose elements are copied
  Eigen::Matrix<double, 6, 1> turned, moved;
  turned << 0.1, 0, 0, 0, 0, 0.7;
  moved << 0, 0.9, 0, 0.2, 0, 0;
  for (const auto& v : {turned, moved}) frames.push_back(exp(y, v));
  const auto d = dispersionAbout(frames, y);
  ASSERT_EQ(d.farthest.size(), 2u);
  EXPECT_EQ(d.farthest[0].block.part, TangentPart::translation);
  EXPECT_NEAR(d.farthest[0].distance, 0.9, 1e-14);
  EXPECT_EQ(d.farthest[0].index, 1u);
  EXPECT_EQ(d.farthest[1].block.part, TangentPart::rotation);
  EXPECT_NEAR(d.farthest[1].distance, 0.7, 1e-14);
  EXPECT_EQ(d.farthest[1].index, 0u);
}

/// Moving everything leaves the dispersion of frames in the local frame as it is.
template <class S>
void expectInvariance() {
  using M = Frame3<S>;
  const M y(SO3<S>::exp({S(0.3), S(-0.2), S(1)}), {S(1), S(2), S(3)});
  const SE3<S> f(SO3<S>::exp({S(-1), S(0.4), S(0.6)}), {S(-2), S(0.5), S(1)});
  std::vector<M> frames, moved;
  for (int i = 0; i < 20; ++i) {
    TangentOf<M> v;
    for (int k = 0; k < 6; ++k) v[k] = S(0.3) * std::sin(S(1 + i * (k + 2)));
    frames.push_back(exp(y, v));
    moved.push_back(ManifoldTraits<M>::act(f, frames.back()));
  }
  const auto here = dispersionAbout(frames, y), there = dispersionAbout(moved, M(ManifoldTraits<M>::act(f, y)));
  // Coordinates of a few metres are rounded once each.
  const S bound = 64 * std::numeric_limits<S>::epsilon();
  EXPECT_LT((here.covariance - there.covariance).norm(), bound);
  EXPECT_EQ(here.farthest[0].index, there.farthest[0].index);
  EXPECT_EQ(here.farthest[1].index, there.farthest[1].index);
}

TEST(Dispersion, IsInvariantDouble) { expectInvariance<double>(); }
TEST(Dispersion, IsInvariantFloat) { expectInvariance<float>(); }

TEST(Dispersion, OfDirectionsIsTheirSquaredAngle) {
  const S2d y(Eigen::Vector3d(1, 2, -2) / 3);
  std::vector<S2d> ring;
  for (int i = 0; i < 8; ++i) {
    const double a = 2 * EIGEN_PI * i / 8;
    ring.push_back(exp(y, Eigen::Vector2d(0.5 * std::cos(a), 0.5 * std::sin(a))));
  }
  const auto d = dispersionAbout(ring, y);
  EXPECT_TRUE(d.covariance.isApprox(0.125 * Eigen::Matrix2d::Identity(), 1e-13));
}

// For points everything is linear, so that the classical formulas hold to rounding.
TEST(Covariance, OfPointsByHand) {
  const std::vector<Eigen::Vector2d> points{{3, 0}, {-1, 0}, {1, 1}, {1, -1}};
  const Eigen::Vector2d centre(1, 0);
  const auto isDiagonal = [](const Eigen::Matrix2d& covariance, double x, double y) {
    EXPECT_LT((covariance - Eigen::Matrix2d(Eigen::Vector2d(x, y).asDiagonal())).norm(), 1e-15);
  };
  isDiagonal(empiricalCovariance(points, centre), 8.0 / 4, 2.0 / 4);
  const auto found = mean(points);
  isDiagonal(covarianceFromResiduals(found), 8.0 / (4 * 3), 2.0 / (4 * 3));
  isDiagonal(covarianceFromResiduals(found, ResidualNoise::any), 8.0 / (4 * 3), 2.0 / (4 * 3));
  isDiagonal(covarianceFromCommonNoise(found, Eigen::Matrix2d(Eigen::Vector2d(2, 1).asDiagonal())), 2.0 / 4, 1.0 / 4);
}

TEST(Concentration, ofTheUniformLawByHand) {
  // ∫ θ² over the density of the angle: 1/π on the circle, sin θ/2 on the sphere, (1 - cos θ)/π on SO(3).
  EXPECT_DOUBLE_EQ(detail::circleLaw().expectation, pi * pi / 3);
  EXPECT_DOUBLE_EQ(detail::sphereLaw().expectation, (pi * pi - 4) / 2);
  EXPECT_DOUBLE_EQ(detail::rotationLaw().expectation, pi * pi / 3 + 2);
  // A mean adapts to its data: they scatter less about it than about any other point, and the less the fewer they are.
  std::vector<detail::UniformLaw> laws{detail::circleLaw(), detail::sphereLaw()};
  for (const auto& row : detail::proper_point_groups) {
    laws.push_back(detail::rotationLaw(*PointGroup::fromName(row.name)));
  }
  for (const auto& law : laws) {
    double before = 0;
    for (const double n : {2.0, 3.0, 10.0, 100.0, 1e6}) {
      EXPECT_GT(law.limit(n), before) << n;
      before = law.limit(n);
    }
    EXPECT_LT(before, law.expectation);
    EXPECT_EQ(law.limit(1), 0);
  }
}

TEST(Concentration, ofTwoAnglesByHand) {
  // ±θ about zero have the mean square θ², and a quarter of π²/3 is (0.9069 rad)².
  const auto about = [](double angle, const std::vector<double>& weights) {
    return concentration(std::vector<SO2d>{SO2d(angle), SO2d(-angle), SO2d(angle), SO2d(-angle)}, weights, SO2d(0.0));
  };
  EXPECT_NEAR(about(0.9, {1, 1, 1, 1}).mean_square, 0.81, 1e-15);
  EXPECT_TRUE(about(0.9, {1, 1, 1, 1}).isModest());
  EXPECT_FALSE(about(0.92, {1, 1, 1, 1}).isModest());
  // Weights count as (Σw)²/Σw² data, whatever their unit.
  EXPECT_DOUBLE_EQ(about(0.9, {5, 5, 5, 5}).limit, detail::circleLaw().limit(4));
  EXPECT_DOUBLE_EQ(about(0.9, {5, 5, 5, 0}).limit, detail::circleLaw().limit(3));
  EXPECT_DOUBLE_EQ(about(0.9, {4, 2, 1, 1}).limit, detail::circleLaw().limit(64.0 / 22));
}

/// The fraction of samples of n rows that are called dependent; errors of a first-order autoregression.
template <class M>
double flagged(double rho, int n, int trials, bool heavy_tails = false) {
  constexpr int k = ManifoldTraits<M>::DoF;
  int dependent = 0;
  for (int t = 0; t < trials; ++t) {
    CounterRng rng(3, static_cast<std::uint64_t>(t));
    TangentOf<M> e = rng.template normalVector<k>();
    std::vector<M> rows;
    for (int i = 0; i < n; ++i) {
      TangentOf<M> w = rng.template normalVector<k>();
      if (heavy_tails) w *= std::exp(rng.normal());
      e = rho * e + std::sqrt(1 - rho * rho) * w;
      rows.push_back(exp(ManifoldTraits<M>::origin(), TangentOf<M>(0.2 * e)));
    }
    dependent += dispersionAbout(rows, mean(rows).mean).order.dependent();
  }
  return static_cast<double>(dependent) / trials;
}

TEST(RowOrder, seesAutoregressions) {
  constexpr int trials = 500;
  const double margin = 4 * std::sqrt(0.99 * 0.01 / trials);
  EXPECT_GE(flagged<SO2d>(0.5, 120, trials), 0.99 - margin);
  EXPECT_GE(flagged<S2d>(0.5, 60, trials), 0.99 - margin);
  EXPECT_GE(flagged<SO3d>(0.5, 50, trials), 0.99 - margin);
  EXPECT_GE(flagged<SO2d>(0.9, 50, trials), 0.99 - margin);
  EXPECT_GE(flagged<Frame3d>(0.9, 50, trials), 0.99 - margin);
}

TEST(RowOrder, independentRowsAreNotFlagged) {
  constexpr int trials = 1000;
  const double most = 0.01 + 4 * std::sqrt(0.99 * 0.01 / trials);
  for (const bool heavy_tails : {false, true}) {
    for (const int n : {25, 100}) {
      EXPECT_LE(flagged<SO2d>(0, n, trials, heavy_tails), most) << n;
      EXPECT_LE(flagged<SO3d>(0, n, trials, heavy_tails), most) << n;
      EXPECT_LE(flagged<Frame3d>(0, n, trials, heavy_tails), most) << n;
    }
  }
}

TEST(RowOrder, saysTheCorrelation) {
  CounterRng rng(7, 0);
  std::vector<Eigen::Vector3d> rows;
  Eigen::Vector3d e(0, 0, 0);
  for (int i = 0; i < 20000; ++i) {
    e = 0.6 * e + 0.8 * rng.normalVector<3>();
    // Units that differ by factors of hundreds are whitened away.
    rows.push_back({e.x(), 100 * e.y(), 0.01 * e.z()});
  }
  const RowOrder order = dispersionAbout(rows, mean(rows).mean).order;
  EXPECT_NEAR(order.correlation, 0.6, 4 * 0.8 / std::sqrt(3 * 20000.0));
  EXPECT_NEAR(order.varianceFactor(), 4, 0.15);
  EXPECT_FALSE(dispersionAbout(std::vector<Eigen::Vector3d>(24, {1, 2, 3}), Eigen::Vector3d(0, 0, 0)).order.tested());
  // All rows at the mean: there is nothing to compare.
  EXPECT_FALSE(
      dispersionAbout(std::vector<Eigen::Vector3d>(30, {1, 2, 3}), Eigen::Vector3d(1, 2, 3)).order.dependent());
}

TEST(Skewness, isMardias) {
  CounterRng rng(3);
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (int i = 0; i < 40; ++i) {
    const double a = -std::log(rng.uniform()), b = rng.normal(), c = -std::log(rng.uniform());
    points.emplace_back(a, a + b, 1e-3 * (b - c));
    mean += points.back() / 40;
  }
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const auto& x : points) scatter += (x - mean) * (x - mean).transpose() / 40;
  const Eigen::Matrix3d inverse = scatter.inverse();
  double b = 0;
  for (const auto& x : points) {
    for (const auto& y : points) b += std::pow((x - mean).dot(inverse * (y - mean)), 3) / (40 * 40);
  }
  const Skewness found = dispersionAbout(points, mean).skewness;
  EXPECT_NEAR(found.b, b, 1e-6 * b);
  EXPECT_EQ(found.n, 40u);
  // χ² of ten degrees of freedom, with Mardia's correction.
  EXPECT_NEAR(found.p, detail::chiSquaredTail(b / 6 * 41 * 43 * 4 / (41.0 * 4 - 6), 10), 1e-6);
}

TEST(Skewness, ofExponentialErrorsIsSeenAndOfNormalOnesIsNot) {
  constexpr int trials = 2000;
  int seen = 0, false_alarms = 0;
  for (std::uint64_t trial = 0; trial < trials; ++trial) {
    CounterRng rng(5, trial);
    std::vector<SO3d> skewed, normal;
    for (int i = 0; i < 50; ++i) {
      Eigen::Vector3d e;
      for (int k = 0; k < 3; ++k) e[k] = -std::log(rng.uniform()) - 1;
      skewed.push_back(SO3d::exp(0.05 * e));
      normal.push_back(SO3d::exp(0.05 * rng.normalVector<3>()));
    }
    seen += dispersionAbout(skewed, liestat::mean(skewed).mean).skewness.matters();
    false_alarms += dispersionAbout(normal, liestat::mean(normal).mean).skewness.matters();
  }
  // 1 of 1000 by the law of many errors; 4 standard errors of 5 of 1000 are 6 of 1000.
  EXPECT_LE(false_alarms, trials * 11 / 1000);
  EXPECT_GE(seen, trials * 95 / 100);
}

TEST(Skewness, isNotTestedOfTooFewOrManyMeasurements) {
  CounterRng rng(9);
  std::vector<S2d> directions;
  for (std::size_t i = 0; i < Skewness::max_rows + 1; ++i) {
    directions.push_back(exp(S2d(), TangentOf<S2d>(0.05 * rng.normalVector<2>())));
  }
  EXPECT_FALSE(dispersionAbout(directions, S2d()).skewness.tested());
  directions.resize(Skewness::max_rows);
  EXPECT_TRUE(dispersionAbout(directions, S2d()).skewness.tested());
  directions.resize(Skewness::min_rows - 1);
  EXPECT_FALSE(dispersionAbout(directions, S2d()).skewness.tested());
}

}  // namespace
