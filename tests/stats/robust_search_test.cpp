// Robust search: conics among points of which a share lies anywhere.

#include <support/constrained_models.hpp>
#include <stats/measurement_error.hpp>
#include <stats/robust_search.hpp>

#include <lie/detail/small_orthogonal.hpp>

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

/// Conics through points with known noise.
struct ConicModel {
  using Parameter = Vector6d;
  static constexpr std::size_t sample_size = 5;
  std::vector<Eigen::Vector2d> points;
  double sigma;

  std::size_t size() const { return points.size(); }
  /// The null vector of five equations, which are linear in q.
  void solve(std::span<const std::size_t> sample, std::vector<Vector6d>& solutions) const {
    detail::SmallMatrix rows(6, 6);
    for (int k = 0; k < 5; ++k) {
      const double x = points[sample[static_cast<std::size_t>(k)]].x(), y = points[sample[static_cast<std::size_t>(k)]].y();
      const double row[] = {x * x, x * y, y * y, x, y, 1};
      for (int j = 0; j < 6; ++j) rows(k, j) = row[j];
    }
    const detail::SmallSvd svd(rows);
    if (!(svd.value(4) > 1e-9 * svd.value(0))) return;
    Vector6d q;
    for (int j = 0; j < 6; ++j) q[j] = svd.v(5, j);
    solutions.push_back(q);
  }
  void errors(const Vector6d& q, std::span<double> out) const {
    const IsotropicNoise<2> noise(sigma);
    const auto equation = autoDiff(OnConic{});
    for (std::size_t i = 0; i < points.size(); ++i) out[i] = measurementError(q, points[i], noise, equation).squared;
  }
  std::optional<Vector6d> refine(const Vector6d& q, std::span<const std::size_t> inliers) const {
    std::vector<Eigen::Vector2d> chosen;
    for (const std::size_t i : inliers) chosen.push_back(points[i]);
    const auto r =
        constrainedEstimate(q, measurements(chosen, IsotropicNoise<2>(sigma), autoDiff(OnConic{})), autoDiff(UnitLength{}));
    if (!r.ok()) return {};
    return r.parameter;
  }
};

ConicModel scene(int inliers, int outliers, std::uint64_t seed) {
  ConicModel model{Ellipse(inliers, 0.005, seed).points, 0.005};
  CounterRng rng(seed, 99);
  for (int i = 0; i < outliers; ++i) model.points.emplace_back(rng.uniform(-1.5, 1.5), rng.uniform(-1, 1));
  return model;
}

constexpr double threshold = 6.63;  // χ²_{0.99}

template <class Rule>
void findsTheEllipse(const Rule& rule, int inliers, int outliers, std::size_t draws) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const ConicModel model = scene(inliers, outliers, seed);
    RobustSearch search(model, rule, {.inlier_threshold = threshold, .seed = seed});
    double last = search.best().score;
    for (std::size_t k = 0; k < draws; ++k) {
      const bool improved = search.iterate();
      EXPECT_EQ(improved, search.best().score > last);
      last = search.best().score;
    }
    EXPECT_EQ(search.draws(), draws);
    const auto found = search.refined();
    ASSERT_TRUE(found.parameter);
    EXPECT_GE(found.score, search.best().score);
    // Of the points on the ellipse 99 % are inliers, of the others those that lie on it by chance.
    std::size_t right = 0;
    for (const std::size_t i : found.inliers) right += i < static_cast<std::size_t>(inliers);
    EXPECT_GE(right, static_cast<std::size_t>(0.93 * inliers)) << seed;
    EXPECT_LE(found.inliers.size() - right, static_cast<std::size_t>(3 + 0.1 * outliers)) << seed;
    Vector6d truth = Ellipse(1, 0, 0).truth;
    if (truth.dot(*found.parameter) < 0) truth = -truth;
    EXPECT_LE((*found.parameter - truth).norm(), 0.02) << seed;
  }
}

TEST(RobustSearch, FindsTheModelByEachScore) {
  findsTheEllipse(Relevance{2 * threshold}, 100, 50, 200);
  findsTheEllipse(InlierCount{threshold}, 100, 50, 200);
  findsTheEllipse(TruncatedCost{threshold}, 100, 50, 200);
  findsTheEllipse(TrimmedQuantile{0.5}, 100, 50, 200);
}

TEST(RobustSearch, FindsTheModelAmongMoreOutliersThanInliers) {
  // 1 - (1 - 0.4⁵)^T = 0.9999 at T = 895.
  findsTheEllipse(TruncatedCost{threshold}, 80, 120, sampleCount(0.4, 5, 0.9999));
}

TEST(RobustSearch, IsDeterministic) {
  const ConicModel model = scene(40, 20, 1);
  const auto run = [&](std::uint64_t seed) {
    RobustSearch search(model, Relevance{2 * threshold}, {.seed = seed});
    for (int k = 0; k < 50; ++k) search.iterate();
    return search.best();
  };
  EXPECT_EQ(run(3).score, run(3).score);
  EXPECT_EQ(*run(3).parameter, *run(3).parameter);
  EXPECT_EQ(run(3).inliers, run(3).inliers);
  EXPECT_NE(run(3).draw, 0u);
}

TEST(RobustSearch, BadDataFindNothing) {
  const auto best = [](std::vector<Eigen::Vector2d> points) {
    const ConicModel model{std::move(points), 0.01};
    RobustSearch search(model, Relevance{2 * threshold});
    for (int k = 0; k < 20; ++k) search.iterate();
    return search.refined();
  };
  EXPECT_FALSE(best({}).parameter) << "nothing";
  EXPECT_FALSE(best(std::vector<Eigen::Vector2d>(4, {1, 0})).parameter) << "fewer than a sample";
  EXPECT_FALSE(best(std::vector<Eigen::Vector2d>(40, {1, 0})).parameter) << "all the same";
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(best(std::vector<Eigen::Vector2d>(40, {nan, nan})).parameter) << "no numbers";
  std::vector<Eigen::Vector2d> line;
  for (int i = 0; i < 40; ++i) line.emplace_back(0.1 * i, 0.2 * i);
  EXPECT_FALSE(best(line).parameter) << "points on a line leave two directions of a conic open";
}

}  // namespace
