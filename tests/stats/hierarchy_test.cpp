// The search through a hierarchy: which model it chooses, and that its answer is one of the measurements alone.

#include <stats/hierarchy.hpp>
#include <stats/random.hpp>
#include <support/curve_models.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace liestat;
using namespace liestat_test;

using Curves = Hierarchy<Eigen::Vector2d, Eigen::Vector3d>;

/// Runs to the end; how many steps that took.
int finish(Curves& search) {
  int steps = 0;
  while (search.iterate()) EXPECT_LT(++steps, 100000);
  return steps;
}
std::string chosen(const Curves& search) { return search.models()[search.best()]->name(); }

/// Inliers of a model by their coordinates.
std::multiset<std::pair<double, double>> inliersOf(const Curves& search, std::size_t m,
                                                   const std::vector<std::pair<Curves::Id, Eigen::Vector2d>>& points) {
  std::multiset<std::pair<double, double>> all;
  for (const Curves::Id id : search.state(m).inliers) {
    const auto at = std::find_if(points.begin(), points.end(), [&](const auto& p) { return p.first == id; });
    EXPECT_NE(at, points.end());
    if (at != points.end()) all.emplace(at->second.x(), at->second.y());
  }
  return all;
}

const std::vector<std::pair<std::string, Eigen::Vector3d>> truths = {{"zero", {0, 0, 0}},
                                                                     {"constant", {2, 0, 0}},
                                                                     {"slope", {0, 1, 0}},
                                                                     {"line", {-1, 2, 0}},
                                                                     {"parabola", {1, 0.5, -0.6}}};

TEST(Hierarchy, ChoosesTheModelOfTheInliers) {
  // The support test's level and that of κ = 8.8 leave less than one wrong choice in a hundred; 40 trials a model, of
  // which four standard errors are three.
  for (const auto& [name, q] : truths) {
    int right = 0;
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
      Curves search(curveModels());
      EXPECT_EQ(search.progress(), HierarchyState::initial);
      search.add(curvePoints(q, 60, 25, seed));
      finish(search);
      EXPECT_EQ(search.progress(), HierarchyState::terminated);
      if (chosen(search) != name) continue;
      ++right;
      const auto& found = search.state(search.best());
      const double sigma = curve_sigma / std::sqrt(55);
      EXPECT_LE((found.estimate.parameter - q).norm(), 8 * sigma) << name << " " << seed;
      EXPECT_GE(found.inliers.size(), 53u);
      EXPECT_DOUBLE_EQ(found.relevance, Relevance{2 * found.threshold}(found.errors)) << "(29), t the threshold";
      EXPECT_EQ(found.rejection, Rejection::none);
    }
    EXPECT_GE(right, 37) << name;
  }
}

TEST(Hierarchy, SaysWhyAModelIsRejected) {
  Curves search(curveModels());
  search.add(curvePoints({1, 0.5, -0.6}, 60, 20, 3));
  finish(search);
  ASSERT_EQ(chosen(search), "parabola");
  for (const char* other : {"zero", "constant", "slope", "line"}) {
    const auto& state = search.state(search.find(other));
    EXPECT_EQ(state.rejection, Rejection::support) << other;
    ASSERT_TRUE(state.rejected_by);
    EXPECT_TRUE(search.contains(*state.rejected_by, search.find(other)));
  }
  // A bend that no point is far from speaks through the fit.
  HierarchyOptions guarded;
  guarded.choice.support.guard = 9;
  Curves bent(curveModels(), guarded);
  bent.add(curvePoints({-1, 2, 0.012}, 400, 20, 3));
  finish(bent);
  ASSERT_EQ(chosen(bent), "parabola");
  EXPECT_EQ(bent.state(bent.find("line")).rejection, Rejection::fit);
}

TEST(Hierarchy, OtherRulesChooseFromTheSameEstimates) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const auto& [name, q] = truths[seed % truths.size()];
    Curves search(curveModels(), {.all_models = true}), lazy(curveModels());
    search.add(curvePoints(q, 60, 20, seed)), lazy.add(curvePoints(q, 60, 20, seed));
    finish(search), finish(lazy);
    for (const auto& state : search.states())
      EXPECT_EQ(state.progress, ModelState<Eigen::Vector3d>::Progress::evaluated);
    EXPECT_EQ(search.best(), search.best(SupportTest{}, ExponentialPhi{})) << "the rule of the options";
    EXPECT_EQ(search.best(), lazy.best()) << "models that the walk does not reach would not be chosen";
    // With so large a Φ every general model rejects what it contains.
    const auto generous = [](double r, double r_general) { return 10 * r / r_general; };
    EXPECT_EQ(search.models()[search.best(SupportTest{}, generous)]->name(), "parabola");
    for (std::size_t m = 0; m < search.models().size(); ++m) {
      for (std::size_t g = 0; g < search.models().size(); ++g) {
        if (!search.contains(g, m)) continue;
        EXPECT_EQ(search.compare(m, g), search.compare(m, g, SupportTest{}, ExponentialPhi{}));
      }
    }
  }
}

TEST(Hierarchy, IsTheSameForAnyOrderOfAddingAndRemoving) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const auto& q = truths[seed % truths.size()].second;
    const std::vector<Eigen::Vector2d> points = curvePoints(q, 40, 20, seed);
    const std::vector<Eigen::Vector2d> others =
        curvePoints(truths[(seed + 1) % truths.size()].second, 30, 5, seed + 50);
    // The points that stay in the end: all of `points` but the first five.
    Curves fresh(curveModels());
    std::vector<std::pair<Curves::Id, Eigen::Vector2d>> fresh_points;
    for (std::size_t i = 5; i < points.size(); ++i) fresh_points.emplace_back(fresh.add(points[i]), points[i]);
    finish(fresh);

    CounterRng rng(seed, 9);
    Curves search(curveModels());
    std::vector<std::pair<Curves::Id, Eigen::Vector2d>> present;
    std::vector<Eigen::Vector2d> to_add = points;
    to_add.insert(to_add.end(), others.begin(), others.end());
    for (std::size_t i = to_add.size() - 1; i > 0; --i) {
      std::swap(to_add[i], to_add[static_cast<std::size_t>(rng.uniform() * static_cast<double>(i + 1))]);
    }
    std::size_t changes = 0;
    for (const Eigen::Vector2d& p : to_add) {
      present.emplace_back(search.add(p), p);
      // Some rest now and then, in the middle of the search or at its end.
      if (++changes % 7 == 0) {
        for (int k = 0; k < 20; ++k) search.iterate();
      }
      if (changes % 31 == 0) finish(search);
    }
    const auto stays = [&](const Eigen::Vector2d& p) {
      return std::find(points.begin() + 5, points.end(), p) != points.end();
    };
    while (present.size() > fresh_points.size()) {
      const auto i = static_cast<std::size_t>(rng.uniform() * static_cast<double>(present.size()));
      if (stays(present[i].second)) continue;
      EXPECT_TRUE(search.remove(present[i].first));
      EXPECT_FALSE(search.remove(present[i].first));
      present.erase(present.begin() + static_cast<std::ptrdiff_t>(i));
      if (++changes % 5 == 0) {
        for (int k = 0; k < 30; ++k) search.iterate();
      }
    }
    finish(search);

    EXPECT_EQ(chosen(search), chosen(fresh)) << seed;
    EXPECT_EQ(search.size(), fresh.size());
    for (std::size_t m = 0; m < search.models().size(); ++m) {
      const auto &a = search.state(m), &b = fresh.state(m);
      ASSERT_EQ(a.progress, b.progress) << seed << " " << search.models()[m]->name();
      EXPECT_EQ(a.draws, b.draws);
      EXPECT_EQ(a.hasEstimate(), b.hasEstimate());
      EXPECT_FALSE(a.outdated);
      if (!a.hasEstimate() || !b.hasEstimate()) continue;
      EXPECT_LE((a.estimate.parameter - b.estimate.parameter).norm(), 1e-9);
      EXPECT_EQ(a.score, b.score);
      EXPECT_EQ(a.rejection, b.rejection);
      EXPECT_EQ(inliersOf(search, m, present), inliersOf(fresh, m, fresh_points)) << seed;
    }
  }
}

TEST(Hierarchy, EqualMeasurementsAreTakenOneByOne) {
  const std::vector<Eigen::Vector2d> points = curvePoints({-1, 2, 0}, 30, 5, 1);
  const auto run = [&](bool extra) {
    auto search = std::make_unique<Curves>(curveModels());
    std::vector<Curves::Id> twins;
    for (const Eigen::Vector2d& p : points) {
      for (int k = 0; k < 3; ++k) search->add(p);
      if (extra) twins.push_back(search->add(p));
    }
    finish(*search);
    for (const Curves::Id id : twins) EXPECT_TRUE(search->remove(id));
    finish(*search);
    return search;
  };
  const auto a = run(false), b = run(true);
  EXPECT_EQ(chosen(*a), chosen(*b));
  EXPECT_EQ(a->state(a->best()).estimate.parameter, b->state(b->best()).estimate.parameter);
}

TEST(Hierarchy, AnOutlierCostsHardlyAnEstimate) {
  const auto models = curveModels();
  const auto estimates = [&] {
    int sum = 0;
    for (const auto& m : models) sum += static_cast<const Curve&>(*m).estimates;
    return sum;
  };
  Curves search(models);
  search.add(curvePoints({-1, 2, 0}, 60, 10, 1));
  finish(search);
  ASSERT_EQ(chosen(search), "line");
  const int before = estimates();
  const int steps = finish(search);
  EXPECT_EQ(steps, 0);
  const Curves::Id outlier = search.add(Eigen::Vector2d(1, -9));
  EXPECT_EQ(search.progress(), HierarchyState::available);
  // There is an answer at once.
  EXPECT_EQ(chosen(search), "line");
  EXPECT_TRUE(search.state(search.best()).outdated);
  finish(search);
  // Few of the refined hypotheses come from draws that now take the outlier.
  EXPECT_LE(estimates(), before + before / 4) << "an outlier of all models";
  EXPECT_EQ(chosen(search), "line");
  search.remove(outlier);
  finish(search);
  EXPECT_LE(estimates(), before + before / 4);
  const int then = estimates();
  search.add(Eigen::Vector2d(1, 1.01));
  finish(search);
  EXPECT_GT(estimates(), then + before / 4) << "an inlier";
}

TEST(Hierarchy, ChangesItsMindWithTheMeasurements) {
  Curves search(curveModels());
  std::vector<Curves::Id> line = search.add(curvePoints({-1, 2, 0}, 40, 0, 1));
  finish(search);
  ASSERT_EQ(chosen(search), "line");
  const std::vector<Curves::Id> parabola = search.add(curvePoints({-1, 2, 0.8}, 60, 0, 2));
  finish(search);
  EXPECT_EQ(chosen(search), "parabola");
  for (const Curves::Id id : parabola) search.remove(id);
  finish(search);
  EXPECT_EQ(chosen(search), "line");
  for (const Curves::Id id : line) search.remove(id);
  EXPECT_EQ(search.size(), 0u);
  finish(search);
  EXPECT_EQ(chosen(search), "zero");
}

TEST(Hierarchy, MayBeInterruptedAnywhere) {
  const std::vector<Eigen::Vector2d> points = curvePoints({1, 0.5, -0.6}, 50, 20, 7);
  Curves whole(curveModels());
  whole.add(points);
  finish(whole);
  Curves search(curveModels());
  search.add(points);
  // Every other call is asked to stop in the estimate.
  int calls = 0;
  bool more = true;
  while (more) {
    ++calls;
    const bool stops = calls % 2 == 1;
    more = search.iterate([&] { return stops; });
    const std::size_t best = search.best();
    EXPECT_LT(best, search.models().size());
    ASSERT_LT(calls, 100000);
  }
  EXPECT_EQ(chosen(search), chosen(whole));
  for (std::size_t m = 0; m < search.models().size(); ++m) {
    EXPECT_EQ(search.state(m).estimate.parameter, whole.state(m).estimate.parameter);
    EXPECT_EQ(search.state(m).draws, whole.state(m).draws);
  }
}

TEST(Hierarchy, GuidedDrawsFindTheSame) {
  HierarchyOptions options;
  options.guided = true;
  for (const auto& [name, q] : truths) {
    Curves search(curveModels(), options);
    search.add(curvePoints(q, 60, 25, 4));
    finish(search);
    EXPECT_EQ(chosen(search), name);
  }
}

TEST(Hierarchy, BadDataLeaveTheNullModel) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::vector<Eigen::Vector2d>> sets = {
      {},
      {{1, 5}},
      std::vector<Eigen::Vector2d>(50, {nan, nan}),
      {{nan, 1}, {2, nan}, {std::numeric_limits<double>::infinity(), 1}},
  };
  for (const auto& points : sets) {
    Curves search(curveModels());
    search.add(points);
    finish(search);
    EXPECT_EQ(search.progress(), HierarchyState::terminated);
    EXPECT_EQ(chosen(search), "zero") << points.size();
  }
  // All the same: a constant, and nothing that two points are needed for.
  Curves search(curveModels());
  search.add(std::vector<Eigen::Vector2d>(50, {1, 5}));
  finish(search);
  EXPECT_TRUE(chosen(search) == "constant" || chosen(search) == "slope");
  EXPECT_FALSE(search.state(search.find("line")).hasEstimate());
}

TEST(Hierarchy, NumbersThatAreNoneChangeNothing) {
  const std::vector<Eigen::Vector2d> points = curvePoints({-1, 2, 0}, 40, 10, 1);
  Curves a(curveModels()), b(curveModels());
  a.add(points), b.add(points);
  b.add(Eigen::Vector2d(std::numeric_limits<double>::quiet_NaN(), 1));
  finish(a), finish(b);
  EXPECT_EQ(chosen(a), "line");
  EXPECT_EQ(chosen(b), "line");
  EXPECT_EQ(a.state(a.best()).inliers.size(), b.state(b.best()).inliers.size());
}

TEST(Hierarchy, SaysWhatIsWrongWithALattice) {
  using Names = std::vector<std::string>;
  const auto fault = [](Curves::Models models) {
    Curves search(std::move(models));
    search.add(Eigen::Vector2d(0, 0));
    EXPECT_FALSE(search.valid());
    EXPECT_FALSE(search.iterate());
    return search.fault();
  };
  const auto root = std::make_shared<Curve>("zero", 0, Names{});
  EXPECT_EQ(fault({}), "no model is without parents");
  EXPECT_EQ(fault({root, std::make_shared<Curve>("zero", 1, Names{"zero"})}), "two models are called zero");
  EXPECT_EQ(fault({root, std::make_shared<Curve>("a", 1, Names{})}), "two models have no parents");
  EXPECT_EQ(fault({root, std::make_shared<Curve>("a", 1, Names{"none"})}), "a has the parent none, which is no model");
  EXPECT_EQ(fault({root, std::make_shared<Curve>("a", 1, Names{"b"}), std::make_shared<Curve>("b", 1, Names{"a"})}),
            "a contains itself");

  /// Numbers beyond what a search can hold.
  struct Large : Curve {
    std::size_t sample;
    int values;
    Large(std::size_t sample_size, int equations)
        : Curve("large", 1, {"zero"}), sample(sample_size), values(equations) {}
    std::size_t sampleSize() const override { return sample; }
    int equations() const override { return values; }
  };
  EXPECT_EQ(fault({root, std::make_shared<Large>(17, 1)}), "large has minimal samples of 17, 16 at most are drawn");
  EXPECT_EQ(fault({root, std::make_shared<Large>(1, 33)}), "large has 33 equations, they are 1 to 32");
  EXPECT_EQ(fault({root, std::make_shared<Large>(1, 0)}), "large has 0 equations, they are 1 to 32");
  EXPECT_TRUE(Curves({root, std::make_shared<Large>(16, 32)}).valid());
  for (const double share : {0.0, 1.0, -0.1, std::numeric_limits<double>::quiet_NaN()}) {
    Curves search({root}, {.outlier_share = share});
    search.add(Eigen::Vector2d(0, 0));
    EXPECT_FALSE(search.iterate());
    EXPECT_EQ(search.fault(), "the share of outliers is not between 0 and 1") << share;
  }
}

}  // namespace
