// Robust search: conics among points of which a share lies anywhere; the hooks on lines.

#include <stats/robust_search.hpp>

#include <stats/measurement_error.hpp>
#include <support/allocations.hpp>
#include <support/constrained_models.hpp>
#include <support/sanitized.hpp>

#include <lie/detail/small_orthogonal.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

constexpr double threshold = 6.6349;  // χ²_{0.99}, one equation

/// Conics through points with known noise, without the optional hooks.
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
      const Eigen::Vector2d& p = points[sample[static_cast<std::size_t>(k)]];
      const double x = p.x(), y = p.y(), row[] = {x * x, x * y, y * y, x, y, 1};
      for (int j = 0; j < 6; ++j) rows(k, j) = row[j];
    }
    const detail::SmallSvd svd(rows);
    if (!(svd.value(4) > 1e-9 * svd.value(0))) return;
    Vector6d q = Vector6d::Zero();
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
    const auto r = constrainedEstimate(q, measurements(chosen, IsotropicNoise<2>(sigma), autoDiff(OnConic{})),
                                       autoDiff(UnitLength{}));
    if (!r.ok()) return {};
    return r.parameter;
  }
};

ConicModel ellipseScene(int inliers, int outliers, std::uint64_t seed) {
  ConicModel model{Ellipse(inliers, 0.005, seed).points, 0.005};
  CounterRng rng(seed, 99);
  for (int i = 0; i < outliers; ++i) model.points.emplace_back(rng.uniform(-1.5, 1.5), rng.uniform(-1, 1));
  return model;
}

template <class Rule>
void findsTheEllipse(const Rule& rule, int inliers, int outliers, std::size_t draws) {
  for (std::uint64_t seed = 0; seed < (liestat_test::sanitized ? 1 : 5); ++seed) {
    const ConicModel model = ellipseScene(inliers, outliers, seed);
    RobustSearch search(model, rule, {.inlier_threshold = threshold, .seed = seed});
    double last = search.best().score;
    for (std::size_t k = 0; k < draws; ++k) {
      const bool improved = search.iterate();
      EXPECT_EQ(improved, search.best().score > last);
      last = search.best().score;
    }
    EXPECT_EQ(search.draws(), draws);
    EXPECT_EQ(search.history().entries().back().score, last);
    const auto found = search.refined();
    ASSERT_TRUE(found.parameter);
    EXPECT_TRUE(found.refined);
    // Inliers are 99 % of the points on the ellipse, and the others that lie on it by chance.
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
  findsTheEllipse(Relevance{2 * threshold}, 100, 50, 150);
  findsTheEllipse(InlierCount{threshold}, 100, 50, 150);
  findsTheEllipse(TruncatedCost{threshold}, 100, 50, 150);
  findsTheEllipse(TrimmedQuantile{0.5}, 100, 50, 150);
}

TEST(RobustSearch, FindsTheModelAmongMoreOutliersThanInliers) {
  // 1 - (1 - 0.4⁵)^T = 0.9999 at T = 895.
  EXPECT_EQ(sampleCount(0.4, 5, 0.9999), 895u);
  findsTheEllipse(TruncatedCost{threshold}, 80, 120, 895);
}

// Half the true deviation, 40 % outliers: what is found is right, its covariance is not, and the search says so.
TEST(RobustSearch, SaysThatTheStatedNoiseIsTooSmall) {
  int said = 0, alarms = 0;
  const int seeds = liestat_test::sanitized ? 1 : 10;
  for (std::uint64_t seed = 0; seed < static_cast<std::uint64_t>(seeds); ++seed) {
    for (const double factor : {0.5, 1.0}) {
      ConicModel model = ellipseScene(120, 80, seed + 40);
      model.sigma *= factor;
      RobustSearch search(model, TruncatedCost{threshold}, {.inlier_threshold = threshold, .seed = seed});
      for (int k = 0; k < 150; ++k) search.iterate();
      const auto found = search.refined();
      ASSERT_TRUE(found.parameter && found.noise.tested());
      EXPECT_EQ(found.status() == Status::inconsistent, found.noise.refuted());
      (factor < 1 ? said : alarms) += found.noise.refuted();
    }
  }
  EXPECT_GE(said, seeds - 1);
  EXPECT_LE(alarms, 1);
}

TEST(RobustSearch, BadDataFindNothing) {
  const auto best = [](std::vector<Eigen::Vector2d> points) {
    const ConicModel model{std::move(points), 0.01};
    RobustSearch search(model, Relevance{2 * threshold});
    for (int k = 0; k < 20; ++k) search.iterate();
    EXPECT_FALSE(search.confidenceReached(0.5));
    return search.refined();
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(best({}).parameter) << "nothing";
  EXPECT_FALSE(best(std::vector<Eigen::Vector2d>(4, {1, 0})).parameter) << "fewer than a sample";
  EXPECT_FALSE(best(std::vector<Eigen::Vector2d>(40, {1, 0})).parameter) << "all the same";
  EXPECT_FALSE(best(std::vector<Eigen::Vector2d>(40, {nan, nan})).parameter) << "no numbers";
  std::vector<Eigen::Vector2d> line;
  for (int i = 0; i < 40; ++i) line.emplace_back(0.1 * i, 0.2 * i);
  EXPECT_FALSE(best(line).parameter) << "points on a line leave two directions of a conic open";
  // Among good points those without numbers are outliers.
  ConicModel model = ellipseScene(40, 0, 1);
  for (int i = 0; i < 20; ++i) model.points.emplace_back(nan, 0);
  RobustSearch search(model, TruncatedCost{threshold});
  for (int k = 0; k < 100; ++k) search.iterate();
  const auto found = search.refined();
  ASSERT_TRUE(found.parameter);
  EXPECT_GE(found.inliers.size(), 36u);
  EXPECT_LT(found.inliers.back(), 40u);
}

/// Lines a x + b y + c = 0, (a, b) a unit vector, with all hooks.
struct LineModel {
  using Parameter = Eigen::Vector3d;
  static constexpr std::size_t sample_size = 2;
  std::vector<Eigen::Vector2d> points;
  double sigma;

  std::size_t size() const { return points.size(); }
  void solve(std::span<const std::size_t> sample, std::vector<Eigen::Vector3d>& solutions) const {
    const Eigen::Vector2d p = points[sample[0]], d = points[sample[1]] - p;
    if (!(d.norm() > 0)) return;
    const Eigen::Vector2d n = Eigen::Vector2d(-d.y(), d.x()) / d.norm();
    solutions.emplace_back(n.x(), n.y(), -n.dot(p));
  }
  double error(const Eigen::Vector3d& line, std::size_t i) const {
    const double distance = (line.head<2>().dot(points[i]) + line.z()) / sigma;
    return distance * distance;
  }
  void errors(const Eigen::Vector3d& line, std::span<double> out) const {
    for (std::size_t i = 0; i < points.size(); ++i) out[i] = error(line, i);
  }
  std::optional<Eigen::Vector3d> refine(const Eigen::Vector3d&, std::span<const std::size_t> inliers) const {
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const std::size_t i : inliers) mean += points[i] / static_cast<double>(inliers.size());
    double xx = 0, xy = 0, yy = 0;
    for (const std::size_t i : inliers) {
      const Eigen::Vector2d d = points[i] - mean;
      xx += d.x() * d.x(), xy += d.x() * d.y(), yy += d.y() * d.y();
    }
    const double angle = 0.5 * std::atan2(2 * xy, xx - yy);
    const Eigen::Vector2d n(-std::sin(angle), std::cos(angle));
    return Eigen::Vector3d(n.x(), n.y(), -n.dot(mean));
  }
};
struct LineModelOfSome : LineModel {
  using LineModel::errors;
  void errors(const Eigen::Vector3d& line, std::span<const std::size_t> some, std::span<double> out) const {
    for (std::size_t k = 0; k < some.size(); ++k) out[k] = error(line, some[k]);
  }
};
struct PolishedLineModel : LineModel {
  std::optional<Eigen::Vector3d> polish(const Eigen::Vector3d& line, std::span<const std::size_t> inliers) const {
    return refine(line, inliers);
  }
};
static_assert(RobustModel<LineModel> && !ModelOfSome<LineModel> && !PolishedModel<LineModel>);
static_assert(ModelOfSome<LineModelOfSome> && PolishedModel<PolishedLineModel>);

/// The line y = 0.5 x among uniform points; inliers first, which no random order may mind.
template <class Model>
Model lineScene(int inliers, int outliers, std::uint64_t seed) {
  Model model;
  model.sigma = 0.01;
  CounterRng rng(seed);
  for (int i = 0; i < inliers + outliers; ++i) {
    const double x = rng.uniform(-1, 1);
    model.points.emplace_back(x, i < inliers ? 0.5 * x + 0.01 * std::sqrt(1.25) * rng.normal() : rng.uniform(-1, 1));
  }
  return model;
}

template <class Model, class Rule>
auto searched(const Model& model, const Rule& rule, const RobustSearchOptions& options, int draws = 200) {
  RobustSearch search(model, rule, options);
  for (int k = 0; k < draws; ++k) search.iterate();
  return search;
}

template <class Rule>
void rejectionChangesNothing(const Rule& rule, double largest_share) {
  std::size_t with = 0, without = 0;
  constexpr std::size_t scenes = 5;
  for (std::uint64_t seed = 0; seed < scenes; ++seed) {
    const auto model = lineScene<LineModelOfSome>(300, 200, seed);
    const auto a = searched(model, rule, {.seed = seed}),
               b = searched(model, rule, {.seed = seed, .early_rejection = false});
    const auto c = searched(static_cast<const LineModel&>(model), rule, {.seed = seed});
    for (const auto& other : {b.best(), c.best()}) {
      EXPECT_EQ(a.best().score, other.score);
      EXPECT_EQ(a.best().draw, other.draw);
      EXPECT_EQ(a.best().inliers, other.inliers);
      EXPECT_EQ(*a.best().parameter, *other.parameter);
    }
    ASSERT_EQ(a.history().entries().size(), b.history().entries().size());
    for (std::size_t k = 0; k < a.history().entries().size(); ++k) {
      EXPECT_EQ(a.history().entries()[k].draw, b.history().entries()[k].draw);
    }
    with += a.evaluatedErrors(), without += b.evaluatedErrors();
  }
  EXPECT_EQ(without, scenes * 200u * 500u);
  EXPECT_LT(static_cast<double>(with), largest_share * static_cast<double>(without));
}

TEST(RobustSearch, EarlyRejectionChangesNoResult) {
  // With 60 % inliers a wrong hypothesis is known after some 40 % of the measurements, a right one only at the end.
  rejectionChangesNothing(InlierCount{threshold}, 0.85);
  rejectionChangesNothing(TruncatedCost{threshold}, 0.85);
  rejectionChangesNothing(Relevance{2 * threshold}, 0.85);
  rejectionChangesNothing(TrimmedQuantile{0.4}, 0.85);
}

TEST(RobustSearch, ARiskOfRejectionIsKeptAndSavesMost) {
  std::size_t with = 0, without = 0;
  int lost = 0;
  constexpr int scenes = 60;
  for (std::uint64_t seed = 0; seed < scenes; ++seed) {
    const auto model = lineScene<LineModelOfSome>(160, 240, seed);
    const TruncatedCost rule{threshold};
    const auto exact = searched(model, rule, {.seed = seed}),
               risky = searched(model, rule, {.seed = seed, .rejection_risk = 1e-2});
    lost += exact.best().score != risky.best().score;
    with += risky.evaluatedErrors(), without += exact.evaluatedErrors();
  }
  // In each scene one hypothesis decides: it is given up in 1 % of the scenes at most; P(more than 4 of 60) = 4e-4.
  EXPECT_LE(lost, 4);
  EXPECT_LT(static_cast<double>(with), 0.5 * static_cast<double>(without));
}

TEST(RobustSearch, LessThanTheLeastScoreIsNothing) {
  std::size_t with = 0, without = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const TruncatedCost rule{threshold};
    // Uniform points: the best line has some ten of 500 near it.
    const auto noise = lineScene<LineModelOfSome>(0, 500, seed);
    EXPECT_FALSE(searched(noise, rule, {.seed = seed, .min_score = 50}).best().parameter);
    EXPECT_TRUE(searched(noise, rule, {.seed = seed}).best().parameter);
    const auto model = lineScene<LineModelOfSome>(150, 350, seed);
    const auto a = searched(model, rule, {.seed = seed, .rejection_risk = 1e-6, .min_score = 50}),
               b = searched(model, rule, {.seed = seed, .rejection_risk = 1e-6});
    EXPECT_EQ(a.best().draw, b.best().draw);
    EXPECT_EQ(a.best().score, b.best().score);
    with += a.evaluatedErrors(), without += b.evaluatedErrors();
  }
  EXPECT_LT(with, without);
}

TEST(RobustSearch, PolishRaisesTheBest) {
  double with = 0, without = 0;
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    const auto model = lineScene<PolishedLineModel>(60, 60, seed);
    const TruncatedCost rule{threshold};
    const auto a = searched(model, rule, {.seed = seed}, 20),
               b = searched(model, rule, {.seed = seed, .local_optimisation = false}, 20);
    EXPECT_FALSE(b.best().refined);
    with += a.best().score, without += b.best().score;
    // The reported parameter, errors and inliers belong together.
    std::vector<double> errors(model.size());
    model.errors(*a.best().parameter, errors);
    EXPECT_EQ(a.best().score, rule(errors));
    EXPECT_EQ(static_cast<double>(a.best().inliers.size()), InlierCount{threshold}(errors));
  }
  // The best of some five pairs of inliers reaches nine tenths of what the line through all inliers does.
  EXPECT_GT(with, 1.05 * without);
}

TEST(RobustSearch, StopsWhenTheDrawsAreEnough) {
  int found = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const auto model = lineScene<PolishedLineModel>(50, 50, seed);
    RobustSearch search(model, TruncatedCost{threshold}, {.seed = seed});
    EXPECT_EQ(search.neededDraws(0.99), std::numeric_limits<std::size_t>::max());
    while (!search.confidenceReached(0.99)) search.iterate();
    EXPECT_EQ(search.neededDraws(0.99), sampleCount(search.best().inliers.size(), 100, 2, 0.99));
    EXPECT_LT(search.draws(), 100u);
    found += search.best().inliers.size() > 40;
  }
  // 99 % by construction, if every pair of inliers gave the line; pairs that lie near each other do not.
  EXPECT_GE(found, 190);
}

/// A model of no freedom.
struct TheAxis : LineModel {
  static constexpr std::size_t sample_size = 0;
  void solve(std::span<const std::size_t>, std::vector<Eigen::Vector3d>& solutions) const {
    solutions.emplace_back(0, 1, 0);
  }
};

TEST(RobustSearch, AModelWithoutFreedomNeedsNoSample) {
  TheAxis axis;
  axis.sigma = 1;
  axis.points = {{0, 0}, {1, 1}, {2, 10}};
  RobustSearch search(axis, InlierCount{threshold});
  EXPECT_TRUE(search.iterate());
  EXPECT_FALSE(search.iterate());
  EXPECT_EQ(search.best().score, 2);
  EXPECT_TRUE(search.confidenceReached(0.9999)) << "one draw is all";
}

TEST(RobustSearch, IsDeterministic) {
  const auto model = lineScene<LineModelOfSome>(40, 40, 1);
  const auto run = [&](std::uint64_t seed) { return searched(model, Relevance{2 * threshold}, {.seed = seed}).best(); };
  EXPECT_EQ(run(3).score, run(3).score);
  EXPECT_EQ(*run(3).parameter, *run(3).parameter);
  EXPECT_EQ(run(3).inliers, run(3).inliers);
  EXPECT_NE(run(3).draw, 0u);
  EXPECT_NE(*run(3).parameter, *run(4).parameter);
}

TEST(Fig9, ImprovementsBecomeRareAndAJumpFindsTheInliers) {
  std::size_t early = 0, late = 0, found = 0;
  constexpr std::size_t scenes = 25;
  for (std::uint64_t seed = 0; seed < scenes; ++seed) {
    const auto model = lineScene<LineModel>(60, 140, seed);
    const auto all = searched(model, Relevance{2 * threshold}, {.seed = seed}, 400);
    for (const auto& entry : all.history().entries()) early += entry.draw <= 20, late += entry.draw > 380;
    RobustSearch search(model, Relevance{2 * threshold}, {.seed = seed});
    const auto stop = anyOf(Jump{0.1}, DrawsReached{2000});
    while (!stop(search.history(), search.draws())) search.iterate();
    const auto inliers = search.refined().inliers;
    found += std::count_if(inliers.begin(), inliers.end(), [](std::size_t i) { return i < 60; }) >= 54;
  }
  // Among draws that are alike the k-th is the best so far with probability 1/k: 3.6 of the first twenty in each scene,
  // 0.05 of the last twenty.
  EXPECT_NEAR(static_cast<double>(early) / scenes, 3.6, 4 * std::sqrt(3.6 / scenes));
  EXPECT_LT(late, 7u);
  // The relevance of outliers is about 0, that of the line 0.2; all scenes of 100 were right when this was written.
  EXPECT_GE(found, scenes - 1);
}

template <class Model, class Rule>
void allocatesNothing(const Rule& rule) {
  const auto model = lineScene<Model>(100, 100, 1);
  RobustSearch search(model, rule);
  const std::size_t before = liestat::tests::allocations;
  for (int k = 0; k < 200; ++k) search.iterate();
  EXPECT_EQ(liestat::tests::allocations, before);
}

TEST(RobustSearch, IterateAllocatesNothing) {
  allocatesNothing<LineModel>(Relevance{2 * threshold});
  allocatesNothing<LineModelOfSome>(TruncatedCost{threshold});
  allocatesNothing<PolishedLineModel>(InlierCount{threshold});
  allocatesNothing<LineModelOfSome>(TrimmedQuantile{0.4});
}

TEST(RobustSearch, SamplesAreDistinctAndEachIsAsLikely) {
  struct Recorder : LineModel {
    mutable std::vector<int> counts = std::vector<int>(36, 0);
    void solve(std::span<const std::size_t> sample, std::vector<Eigen::Vector3d>&) const {
      ASSERT_NE(sample[0], sample[1]);
      ++counts[6 * std::min(sample[0], sample[1]) + std::max(sample[0], sample[1])];
    }
  };
  Recorder model;
  model.points.resize(6, Eigen::Vector2d::Zero());
  searched(model, Relevance{1}, {}, 15000);
  // Each of 15 pairs 1000 times; four standard deviations of a binomial law are 122.
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = i + 1; j < 6; ++j) EXPECT_NEAR(model.counts[6 * i + j], 1000, 122);
  }
}

}  // namespace
