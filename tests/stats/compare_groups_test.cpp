// Comparisons of groups: exact laws on points, levels on manifolds, permutations, pairs, refusals. Levels from 10⁴ trials:
// liestat validate groups.
#include <lie/frame3.hpp>
#include <lie/rn.hpp>
#include <lie/s2.hpp>
#include <lie/se3.hpp>
#include <lie/so2.hpp>
#include <lie/so3.hpp>
#include <stats/compare_groups.hpp>
#include <stats/detail/tail_probabilities.hpp>
#include <stats/random.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

using namespace liestat;

namespace {

template <class M>
std::vector<M> around(const M& centre, std::size_t n, double sd, CounterRng& rng) {
  std::vector<M> list;
  for (std::size_t i = 0; i < n; ++i)
    list.push_back(exp(centre, TangentOf<M>(sd * rng.normalVector<ManifoldTraits<M>::DoF>())));
  return list;
}

Eigen::MatrixXd normals(int n, int d, double sd, CounterRng& rng) {
  Eigen::MatrixXd rows(n, d);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < d; ++k) rows(i, k) = sd * rng.normal();
  }
  return rows;
}

TEST(CompareGroups, twoGroupsOfPointsAreHotellings) {
  // T² = n m/(n + m) δᵀ S⁻¹ δ of the pooled S, computed here by hand.
  CounterRng rng(1);
  for (const int d : {1, 2, 3, 6}) {
    const Eigen::MatrixXd a = normals(30, d, 1, rng), b = normals(40, d, 1, rng).array() + 0.2;
    const Eigen::VectorXd ma = a.colwise().mean(), mb = b.colwise().mean();
    const Eigen::MatrixXd ca = a.rowwise() - ma.transpose(), cb = b.rowwise() - mb.transpose();
    const Eigen::MatrixXd s = (ca.transpose() * ca + cb.transpose() * cb) / 68;
    const double t2 = 30.0 * 40 / 70 * (mb - ma).dot(s.inverse() * (mb - ma));
    const GroupComparison found = compareVectors({a, b});
    ASSERT_EQ(found.status, Status::ok) << found.reason;
    EXPECT_NEAR(found.means_if_alike.p, detail::hotellingTail(t2, d, 69), 1e-10) << d;
    EXPECT_NEAR(found.means_if_alike.statistic, t2 * (69 - d) / (68 * d), 1e-9 * t2) << d;
  }
}

TEST(CompareGroups, welchOnALine) {
  // One dimension: Krishnamoorthy and Yu's law is Welch's.
  CounterRng rng(2);
  const Eigen::MatrixXd a = normals(12, 1, 1, rng), b = normals(25, 1, 3, rng).array() + 1;
  const auto variance = [](const Eigen::MatrixXd& x) {
    return (x.array() - x.mean()).square().sum() / static_cast<double>(x.size() - 1);
  };
  const double va = variance(a) / 12, vb = variance(b) / 25, t = (b.mean() - a.mean()) / std::sqrt(va + vb);
  const double dof = (va + vb) * (va + vb) / (va * va / 11 + vb * vb / 24);
  const GroupComparison found = compareVectors({a, b});
  EXPECT_NEAR(found.means.statistic, t * t, 1e-10);
  EXPECT_NEAR(found.means.denominator_dof, dof, 1e-9);
  EXPECT_NEAR(found.means.p, 2 * detail::studentTail(std::abs(t), dof), 1e-10);
  EXPECT_NEAR(found.pairs[0].difference[0], b.mean() - a.mean(), 1e-14);
  EXPECT_NEAR(found.pairs[0].covariance(0, 0), va + vb, 1e-14);
}

TEST(CompareGroups, wilksOfFourGroupsOnALineIsTheAnalysisOfVariance) {
  CounterRng rng(3);
  std::vector<Eigen::MatrixXd> groups;
  double within = 0, between = 0, sum = 0;
  for (int g = 0; g < 4; ++g) groups.push_back(normals(10 + g, 1, 1, rng)), sum += groups.back().sum();
  for (const Eigen::MatrixXd& g : groups) {
    within += (g.array() - g.mean()).square().sum();
    between += static_cast<double>(g.size()) * (g.mean() - sum / 46) * (g.mean() - sum / 46);
  }
  const GroupComparison found = compareVectors(groups);
  EXPECT_NEAR(found.means_if_alike.statistic, between / 3 / (within / 42), 1e-10);
  EXPECT_EQ(found.means_if_alike.numerator_dof, 3);
  EXPECT_NEAR(found.means_if_alike.denominator_dof, 42, 1e-9);
  EXPECT_EQ(found.pairs.size(), 6U);
  for (const ComparedPair& pair : found.pairs) EXPECT_GE(pair.adjusted_p, pair.means.p);
}

/// Rejections at 5 % of so many trials: four standard errors either way.
template <class M>
void expectLevel(const M& centre, std::vector<double> deviations, std::uint32_t stream) {
  constexpr int trials = 300, d = ManifoldTraits<M>::DoF;
  int means = 0, dispersions = 0;
  ComparisonOptions options;
  options.resamples = 199;
  for (std::uint64_t seed = 0; seed < trials; ++seed) {
    CounterRng rng(seed, 0, stream);
    std::vector<std::vector<M>> groups;
    for (const double sd : deviations) groups.push_back(around(centre, std::max(10, 4 * d), sd, rng));
    const GroupComparison found = compareGroups(groups, options);
    means += found.means.p < 0.05 ? 1 : 0, dispersions += found.dispersions.p < 0.05 ? 1 : 0;
  }
  const double error = 4 * std::sqrt(0.05 * 0.95 * trials);
  EXPECT_NEAR(means, 0.05 * trials, error) << d << " dimensions, " << deviations.size() << " groups";
  if (deviations.front() == deviations.back())
    EXPECT_NEAR(dispersions, 0.05 * trials, error) << d << " dimensions";
  else
    EXPECT_GT(dispersions, 0.3 * trials);
}

TEST(CompareGroups, levelsOnManifolds) {
  expectLevel(S2d(0.6, 0, -0.8), {0.3, 0.3}, 1);
  expectLevel(SO3d::exp({1, 2, -0.5}), {0.4, 0.4, 0.4}, 2);
  expectLevel(SO2d(3.1), {0.2, 0.6}, 3);
  expectLevel(Frame3d(SO3d::exp({0, 3, 0}), {10, -5, 1}), {0.2, 0.2}, 4);
}

TEST(CompareGroups, differencesAreFoundOnEveryManifold) {
  const auto expectFound = [](const auto& centre) {
    using M = std::remove_cvref_t<decltype(centre)>;
    constexpr int k = ManifoldTraits<M>::DoF;
    CounterRng rng(5);
    const M moved = exp(centre, TangentOf<M>(TangentOf<M>::Constant(0.15)));
    const std::vector<std::vector<M>> groups{around(centre, 40, 0.1, rng), around(moved, 40, 0.1, rng)};
    const GroupComparison found = compareGroups(groups);
    ASSERT_EQ(found.status, Status::ok) << found.reason;
    EXPECT_LT(found.means.p, 1e-4);
    EXPECT_TRUE(found.verdict().isNo());
    // The difference is that of the means, within four standard deviations.
    const Eigen::VectorXd off = found.pairs[0].difference.cwiseAbs() - Eigen::VectorXd::Constant(k, 0.15);
    EXPECT_LT(off.dot(found.pairs[0].covariance.inverse() * off), k + 4 * std::sqrt(2.0 * k) + 8);
  };
  expectFound(Eigen::Vector3d(1, 2, 3));
  expectFound(SO2d(3.1));
  expectFound(SO3d::exp({0.4, 0.1, 0}));
  expectFound(Frame3d(SO3d::exp({0.1, 0.2, 0.3}), {1, 2, 3}));
  expectFound(SE3d(SO3d::exp({0.1, 0.2, 0.3}), {1, 2, 3}));
}

TEST(CompareGroups, anotherFrameOrUnitChangesNothing) {
  CounterRng rng(6);
  const SE3d f(SO3d::exp({0.4, 2, -1}), {3, -2, 5});
  std::vector<std::vector<Frame3d>> here{
      around(Frame3d(), 30, 0.2, rng),
      around(exp(Frame3d(), TangentOf<Frame3d>(TangentOf<Frame3d>::Constant(0.1))), 30, 0.3, rng)},
      there, millimetres;
  for (const auto& group : here) {
    there.emplace_back(), millimetres.emplace_back();
    for (const Frame3d& x : group) {
      there.back().push_back(ManifoldTraits<Frame3d>::act(f, x));
      millimetres.back().emplace_back(x.so3(), Eigen::Vector3d(1000 * x.translation()));
    }
  }
  const GroupComparison found = compareGroups(here);
  for (const auto& groups : {there, millimetres}) {
    const GroupComparison other = compareGroups(groups);
    EXPECT_NEAR(other.means.p, found.means.p, 1e-8);
    EXPECT_NEAR(other.means_if_alike.p, found.means_if_alike.p, 1e-8);
    EXPECT_EQ(other.dispersions.p, found.dispersions.p);
  }
}

TEST(CompareGroups, pairsSeeWhatGroupsDoNot) {
  // Each object has its own attitude; both sensors see it, the second one 0.05 rad off.
  CounterRng rng(7);
  std::vector<SO3d> first = around(SO3d::exp({1, 0, 2}), 30, 0.4, rng), second;
  for (const SO3d& x : first)
    second.push_back(x * SO3d::exp(Eigen::Vector3d(0.05, 0, 0) + 0.02 * rng.normalVector<3>()));
  const GroupComparison pairs = comparePairs(first, second), groups = compareGroups(std::vector{first, second});
  ASSERT_EQ(pairs.status, Status::ok) << pairs.reason;
  EXPECT_LT(pairs.means.p, 1e-3);
  EXPECT_GT(groups.means.p, 0.05);
  EXPECT_TRUE(pairs.verdict().isNo());
  second.pop_back();
  EXPECT_EQ(comparePairs(first, second).status, Status::not_applicable);
}

// Skewed noise, equal means: a small group beside a large one is called different in 14 % and more.
TEST(CompareGroups, skewedGroupsOfUnequalSizesHaveNoVerdict) {
  const auto exponential = [](Eigen::Index n, CounterRng& rng) {
    Eigen::MatrixXd rows(n, 3);
    for (double& x : rows.reshaped()) x = -std::log(rng.uniform()) - 1;
    return rows;
  };
  int marked = 0, equal_sizes = 0, normal = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    CounterRng rng(900 + seed);
    const GroupComparison skewed = compareVectors({exponential(12, rng), exponential(500, rng)});
    marked += skewed.status == Status::inconsistent;
    EXPECT_EQ(skewed.ok(), skewed.reason.find("skewed") == std::string::npos);
    equal_sizes += compareVectors({exponential(12, rng), exponential(12, rng)}).ok();
    normal += compareVectors({normals(12, 3, 1, rng), normals(500, 3, 1, rng)}).ok();
  }
  EXPECT_EQ(marked, 20);
  EXPECT_EQ(equal_sizes, 20);
  EXPECT_EQ(normal, 20);  // .001 each
  CounterRng rng(950);
  EXPECT_EQ(compareVectorPairs(exponential(60, rng), Eigen::MatrixXd::Zero(60, 3)).status, Status::inconsistent);
}

TEST(CompareGroups, repeatedRowsHaveNoVerdict) {
  CounterRng rng(960);
  const Eigen::MatrixXd a = normals(20, 3, 1, rng), b = normals(40, 3, 1, rng);
  Eigen::MatrixXd twice(40, 3);
  twice << a, a;
  EXPECT_TRUE(compareVectors({a, b}).ok());
  const GroupComparison found = compareVectors({b, twice});
  EXPECT_EQ(found.status, Status::inconsistent);
  EXPECT_EQ(found.reason.find("group 2: rows are repeated"), 0U) << found.reason;
  EXPECT_EQ(compareVectorPairs(Eigen::MatrixXd::Zero(40, 3), twice).status, Status::inconsistent);
}

TEST(CompareGroups, refusals) {
  CounterRng rng(8);
  const std::vector<SO3d> some = around(SO3d(), 20, 0.2, rng);
  EXPECT_EQ(compareGroups(std::vector<std::vector<SO3d>>{some}).status, Status::too_few);
  EXPECT_EQ(compareGroups(std::vector{some, std::vector<SO3d>{}}).status, Status::too_few);
  const GroupComparison few = compareGroups(std::vector{some, around(SO3d(), 9, 0.2, rng)});
  EXPECT_EQ(few.status, Status::too_few);
  EXPECT_FALSE(std::isnan(few.means.p));
  EXPECT_TRUE(few.verdict().isNone());
  EXPECT_TRUE(std::isnan(compareGroups(std::vector{some, around(SO3d(), 4, 0.2, rng)}).means.p));
  EXPECT_EQ(compareGroups(std::vector{some, std::vector<SO3d>(20, SO3d())}).status, Status::ill_defined);
  std::vector<std::vector<S2d>> uniform(2);
  for (int i = 0; i < 120; ++i) uniform[i % 2 == 0 ? 0 : 1].emplace_back(rng.unitVector<3>());
  EXPECT_EQ(compareGroups(uniform).status, Status::ill_defined);
  std::vector<Eigen::Vector3d> nan(20, Eigen::Vector3d::Ones());
  nan[3][1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(compareGroups(std::vector{nan, nan}).status, Status::ok);
}

}  // namespace
