// Structures one after the other: curves through points (tests/support/curve_models.hpp).

#include <stats/repeated_extraction.hpp>
#include <support/curve_models.hpp>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace liestat;
using liestat_test::Curve;
using liestat_test::curveModels;
using liestat_test::curvePoints;
using Extraction = RepeatedExtraction<Eigen::Vector2d, Eigen::Vector3d>;

/// Three curves with 60, 50 and 40 points, two of them crossing, and 30 points anywhere.
struct ThreeCurves {
  std::vector<Eigen::Vector3d> truth{{1, 2, 0}, {-2, -1, 0}, {6, 0, 0}};
  std::vector<std::string> names{"line", "line", "constant"};
  std::vector<Eigen::Vector2d> points;
  std::vector<std::size_t> label;  // 3: an outlier

  explicit ThreeCurves(std::uint64_t seed) {
    for (std::size_t k = 0; k < 4; ++k) {
      const int count = k < 3 ? 60 - 10 * static_cast<int>(k) : 0;
      const Eigen::Vector3d q = k < 3 ? truth[k] : Eigen::Vector3d(0, 0, 0);
      for (const auto& p : curvePoints(q, count, k < 3 ? 0 : 30, 10 * seed + k)) {
        points.push_back(p), label.push_back(k);
      }
    }
  }
};

std::vector<ExtractedStructure<Eigen::Vector3d>> extract(const std::vector<Eigen::Vector2d>& points,
                                                         const RepeatedExtractionOptions& options = {}) {
  Extraction search(curveModels(), points, options);
  while (search.iterate()) {
  }
  return search.structures();
}

double squaredError(const Eigen::Vector3d& q, const Eigen::Vector2d& p) {
  return std::pow((p.y() - (q[0] + p.x() * (q[1] + p.x() * q[2]))) / liestat_test::curve_sigma, 2);
}

TEST(RepeatedExtraction, FindsEachStructureWithItsModel) {
  std::size_t wrong = 0, all = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const ThreeCurves scene(seed);
    const auto structures = extract(scene.points);
    ASSERT_EQ(structures.size(), 3u) << seed;
    std::vector<std::size_t> found(scene.points.size(), 3);
    std::set<std::size_t> truths;
    for (const auto& s : structures) {
      // The truth with the nearest slope: 2, -1 and 0 are far from each other.
      std::size_t k = 0;
      for (std::size_t j = 1; j < 3; ++j) {
        const auto distance = [&](std::size_t of) { return (s.estimate.parameter - scene.truth[of]).norm(); };
        if (distance(j) < distance(k)) k = j;
      }
      truths.insert(k);
      EXPECT_EQ(s.name, scene.names[k]) << seed;
      EXPECT_EQ(s.name, curveModels()[s.model]->name());
      // 40 points: the standard deviation of the offset is 0.05/√40, of the slope 0.05/(√40 √3); six of them.
      EXPECT_LT((s.estimate.parameter - scene.truth[k]).lpNorm<Eigen::Infinity>(), 6 * 0.05 / std::sqrt(40.0)) << seed;
      for (const std::size_t i : s.inliers) found[i] = k;
    }
    EXPECT_EQ(truths.size(), 3u) << seed;
    for (std::size_t i = 0; i < found.size(); ++i) wrong += found[i] != scene.label[i];
    all += found.size();
  }
  // One per cent of the 1500 inliers lies beyond the threshold; points in the 0.26 by 0.26 boxes around three crossings
  // (some 0.5 % of the outliers' and 2 % of the inliers' range) are anyone's; 4 % of 300 outliers lie on a curve.
  EXPECT_LT(wrong, 0.045 * static_cast<double>(all));
}

TEST(RepeatedExtraction, MeasurementsBelongToTheStructureThatTheyFitBest) {
  const ThreeCurves scene(3);
  Extraction search(curveModels(), scene.points);
  while (search.iterate()) {
  }
  const auto& structures = search.structures();
  ASSERT_EQ(structures.size(), 3u);
  std::vector<std::size_t> owner(scene.points.size(), 3);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_TRUE(std::is_sorted(structures[k].inliers.begin(), structures[k].inliers.end()));
    for (const std::size_t i : structures[k].inliers) {
      EXPECT_EQ(owner[i], 3u) << "two have it";
      owner[i] = k;
    }
  }
  const double threshold = structures[0].state.threshold;
  EXPECT_NEAR(threshold, 6.6349, 1e-4);
  for (std::size_t i = 0; i < owner.size(); ++i) {
    std::size_t best = 3;
    double least = threshold;
    for (std::size_t k = 0; k < 3; ++k) {
      const double e = squaredError(structures[k].estimate.parameter, scene.points[i]);
      if (e < least) best = k, least = e;
    }
    EXPECT_EQ(owner[i], best) << i;
  }
  std::vector<std::size_t> rest;
  for (std::size_t i = 0; i < owner.size(); ++i) {
    if (owner[i] == 3) rest.push_back(i);
  }
  EXPECT_EQ(search.rest(), rest);
  EXPECT_EQ(search.search().size(), rest.size()) << "the last search is over what is left";
}

TEST(RepeatedExtraction, WithoutRoundsTheFirstKeepsWhatItTook) {
  const ThreeCurves scene(3);
  const auto structures = extract(scene.points, {.rounds = 0});
  ASSERT_EQ(structures.size(), 3u);
  std::vector<char> taken(scene.points.size(), 0);
  std::size_t contested = 0;
  for (const auto& s : structures) {
    for (std::size_t i = 0; i < taken.size(); ++i) {
      const bool fits = squaredError(s.state.estimate.parameter, scene.points[i]) < s.state.threshold;
      const bool has = std::binary_search(s.inliers.begin(), s.inliers.end(), i);
      EXPECT_EQ(has, fits && !taken[i]) << i;
      contested += fits && taken[i];
      taken[i] = taken[i] || fits;
    }
    EXPECT_EQ(s.estimate.parameter, s.state.estimate.parameter);
  }
  EXPECT_GT(contested, 0u) << "the curves cross";
}

TEST(RepeatedExtraction, DoesNotDependOnTheOrder) {
  const ThreeCurves scene(5);
  const std::size_t n = scene.points.size();
  std::vector<std::size_t> order(n);
  for (std::size_t i = 0; i < n; ++i) order[i] = (7 * i + 3) % n;  // 7 and 180 have no divisor in common
  std::vector<Eigen::Vector2d> shuffled;
  for (const std::size_t i : order) shuffled.push_back(scene.points[i]);
  const auto a = extract(scene.points), b = extract(shuffled);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); ++k) {
    EXPECT_EQ(a[k].name, b[k].name);
    EXPECT_LT((a[k].estimate.parameter - b[k].estimate.parameter).norm(), 1e-9);
    std::vector<std::size_t> places;
    for (const std::size_t i : b[k].inliers) places.push_back(order[i]);
    std::sort(places.begin(), places.end());
    EXPECT_EQ(a[k].inliers, places);
  }
}

TEST(RepeatedExtraction, MayBeInterrupted) {
  const ThreeCurves scene(2);
  Extraction search(curveModels(), scene.points);
  int asked = 0, calls = 0;
  std::size_t most = 0;
  // An estimate asks twice; every third question is answered with a stop.
  while (search.iterate([&] { return ++asked % 3 == 0; })) {
    ASSERT_LT(++calls, 100000);
    EXPECT_FALSE(search.terminated());
    most = std::max(most, search.structures().size());
  }
  EXPECT_TRUE(search.terminated());
  EXPECT_GE(most, 2u) << "structures are there as soon as they are found";
  const auto whole = extract(scene.points);
  ASSERT_EQ(search.structures().size(), whole.size());
  for (std::size_t k = 0; k < whole.size(); ++k) EXPECT_EQ(search.structures()[k].inliers, whole[k].inliers);
}

TEST(RepeatedExtraction, EndsAtTheLimit) {
  const ThreeCurves scene(1);
  EXPECT_EQ(extract(scene.points, {.max_structures = 2}).size(), 2u);
  EXPECT_EQ(extract(scene.points, {.max_structures = 0}).size(), 0u);
}

TEST(RepeatedExtraction, FindsNothingInNoise) {
  // 0 of 1000 such sets hold a structure by chance, so one of these 20 has less than 2 % probability.
  for (std::uint64_t seed = 1; seed <= 20; ++seed) EXPECT_TRUE(extract(curvePoints({0, 0, 0}, 0, 40, seed)).empty());
  EXPECT_TRUE(extract({}).empty());
  EXPECT_TRUE(extract(std::vector<Eigen::Vector2d>(30, {std::numeric_limits<double>::quiet_NaN(), 1})).empty());
}

TEST(RepeatedExtraction, NeedsALattice) {
  auto models = curveModels();
  models.push_back(std::make_shared<Curve>("cubic", 0b111u, std::vector<std::string>{"quartic"}));
  Extraction search(models, curvePoints({1, 2, 0}, 40, 0, 1));
  EXPECT_FALSE(search.iterate());
  EXPECT_TRUE(search.structures().empty());
  EXPECT_FALSE(search.search().fault().empty());
}

}  // namespace
